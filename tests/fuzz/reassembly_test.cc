// Seeded sequences of true and false fragments and repair symbols, in the normal test suite. The
// same seed gives the same sequences on every machine.
#include "tests/fuzz/reassembly.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace interneuron::flow {
namespace {

constexpr int kSequences = 3000;
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
    sum.complete += done.complete;
  }
  // They must reach behind the first check, and to the end.
  EXPECT_GT(sum.packets, std::size_t{kSequences} * kOperations / 4);
  EXPECT_GT(sum.complete, std::size_t{kSequences});
  RecordProperty("packets", std::to_string(sum.packets));
  RecordProperty("complete", std::to_string(sum.complete));
}

}  // namespace
}  // namespace interneuron::flow
