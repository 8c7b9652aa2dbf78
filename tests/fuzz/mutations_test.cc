// The fuzzer's entry point in the normal test suite: seeded mutations of the documented examples.
// The same seed gives the same bytes on every machine.
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "tests/core/wire/examples.h"
#include "tests/places.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace interneuron::wire::mutations_test {
namespace {

constexpr int kMutations = 300'000;  // chosen: a few seconds in a build with sanitizers
constexpr std::uint64_t kSeed = 1;

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : random_(seed) {
    seeds_ = {from_hex(kDataExample),      from_hex(kPlainExample),  from_hex(kRepairExample),
              from_hex(kFeedbackExample),  from_hex(kProbeExample),  from_hex(kEchoRequestExample),
              from_hex(kEchoReplyExample), from_hex(kWindowExample), example_message()};
  }

  Bytes next() {
    Bytes bytes = seeds_[below(seeds_.size())];
    for (std::size_t times = 1 + below(4); times > 0; --times) mutate(bytes);
    return bytes;
  }

 private:
  std::size_t below(std::size_t n) { return n == 0 ? 0 : random_() % n; }
  std::byte any_byte() { return static_cast<std::byte>(random_() & 0xff); }

  void mutate(Bytes& bytes) {
    const std::size_t at = below(bytes.size());
    const auto here = bytes.begin() + static_cast<std::ptrdiff_t>(at);
    const std::size_t left = bytes.size() - at;
    switch (below(7)) {
      case 0:
        if (left > 0) *here ^= static_cast<std::byte>(1U << below(8));
        break;
      case 1:
        if (left > 0) *here = any_byte();
        break;
      case 2:  // the extremes of a number
        std::fill_n(here, std::min<std::size_t>(left, 1U << below(4)),
                    below(2) == 0 ? std::byte{0} : std::byte{0xff});
        break;
      case 3:  // shorter, with the tag kept
        bytes.erase(here, here + static_cast<std::ptrdiff_t>(std::min(left, 1 + below(80))));
        break;
      case 4:  // longer
        bytes.insert(here, 1 + below(80), any_byte());
        break;
      case 5:
        bytes.resize(at);
        break;
      default: {  // a part of another
        const Bytes& other = seeds_[below(seeds_.size())];
        const std::size_t from = below(other.size());
        std::copy_n(other.begin() + static_cast<std::ptrdiff_t>(from),
                    std::min(left, below(other.size() - from)), here);
      }
    }
  }

  std::mt19937_64 random_;
  std::vector<Bytes> seeds_;
};

Bytes file(const std::string& name) {
  std::ifstream in(places::source() + "/tests/fuzz/corpus/decode/" + name, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

TEST(Decode, TheFuzzerBeginsWithTheDocumentedExamples) {
  EXPECT_EQ(file("data"), from_hex(kDataExample));
  EXPECT_EQ(file("plain"), from_hex(kPlainExample));
  EXPECT_EQ(file("repair"), from_hex(kRepairExample));
  EXPECT_EQ(file("feedback"), from_hex(kFeedbackExample));
  EXPECT_EQ(file("probe"), from_hex(kProbeExample));
  EXPECT_EQ(file("echo_request"), from_hex(kEchoRequestExample));
  EXPECT_EQ(file("echo_reply"), from_hex(kEchoReplyExample));
  EXPECT_EQ(file("challenge"), from_hex(kChallengeExample));
  EXPECT_EQ(file("token"), from_hex(kTokenExample));
  EXPECT_EQ(file("window"), from_hex(kWindowExample));
  EXPECT_EQ(file("message"), example_message());
}

TEST(Decode, SeededMutationsAreRefusedOrValid) {
  Mutator mutator(kSeed);
  std::size_t packets = 0;
  std::size_t messages = 0;
  for (int i = 0; i < kMutations; ++i) {
    const Bytes bytes = mutator.next();
    packets += parse(bytes).has_value() ? 1 : 0;
    messages += parse_round_header(bytes).has_value() ? 1 : 0;
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  }
  // The mutations must reach behind the first check.
  EXPECT_GT(packets, std::size_t{kMutations} / 20);
  EXPECT_GT(messages, std::size_t{kMutations} / 50);
  RecordProperty("valid_packets", std::to_string(packets));
  RecordProperty("valid_messages", std::to_string(messages));
}

}  // namespace
}  // namespace interneuron::wire::mutations_test
