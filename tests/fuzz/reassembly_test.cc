// Seeded sequences of true and false fragments and repair symbols, in the normal test suite. The
// same seed gives the same sequences on every machine.
#include "tests/fuzz/reassembly.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace interneuron::flow::reassembly_test {
namespace {

constexpr int kSequences = 400;
constexpr std::size_t kOperations = 120;

TEST(Reassembly, SeededSequencesKeepItsWord) {
  std::mt19937_64 random(1);
  Reassembled sum;
  for (int i = 0; i < kSequences; ++i) {
    std::vector<std::uint8_t> input(kOperations * kOperationBytes);
    for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(random());
    // Some sequences are true alone, some mostly.
    for (std::size_t at = 0; at < input.size(); at += kOperationBytes) {
      if (i % 3 == 0 || (i % 3 == 1 && random() % 8 > 0)) input[at] |= 0x80U;
    }
    const Reassembled done = reassemble_any(input);
    sum.packets += done.packets;
    for (std::size_t m = 0; m < kMessages; ++m) sum.complete[m] += done.complete[m];
  }
  // They must reach behind the first check, and to the end of each message.
  EXPECT_GT(sum.packets, std::size_t{kSequences} * kOperations);
  RecordProperty("packets", std::to_string(sum.packets));
  for (std::size_t m = 0; m < kMessages; ++m) {
    EXPECT_GT(sum.complete[m], std::size_t{kSequences} / 4) << "message " << m;
    RecordProperty("complete " + std::to_string(m), std::to_string(sum.complete[m]));
  }
}

}  // namespace
}  // namespace interneuron::flow::reassembly_test
