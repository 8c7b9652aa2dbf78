// Seeded programs for an endpoint, in the normal test suite. The same seed gives the same programs
// on every machine.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/fuzz/endpoint_program.h"

namespace interneuron::fuzz {
namespace {

// They take two seconds in a build with sanitizers.
constexpr int kPrograms = 150;

TEST(EndpointPrograms, SeededOnesKeepItsWord) {
  std::mt19937_64 random(1);
  std::size_t peers = 0;
  std::uint64_t messages = 0;
  for (int i = 0; i < kPrograms; ++i) {
    std::vector<std::uint8_t> input(4000);
    for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(random());
    const ProgramResult result = run_program(input);
    peers += result.peers;
    messages += result.messages_completed;
  }
  // They must reach behind the first check.
  EXPECT_GT(peers, std::size_t{kPrograms} / 2);
  EXPECT_GT(messages, std::uint64_t{kPrograms} / 4);
  RecordProperty("peers", std::to_string(peers));
  RecordProperty("messages", std::to_string(messages));
}

}  // namespace
}  // namespace interneuron::fuzz
