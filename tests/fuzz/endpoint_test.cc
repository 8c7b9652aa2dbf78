// Seeded programs for an endpoint, in the normal test suite. The same seed gives the same programs
// on every machine.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/fuzz/endpoint_program.h"

namespace interneuron::fuzz::endpoint_test {
namespace {

// They take two seconds in a build with sanitizers. Those with handshakes take ten times as long.
constexpr int kPrograms = 150;
constexpr int kSealedPrograms = 30;

void run_seeded(World::Protection protection, int programs) {
  std::mt19937_64 random(1);
  std::size_t peers = 0;
  std::uint64_t messages = 0;
  for (int i = 0; i < programs; ++i) {
    std::vector<std::uint8_t> input(4000);
    for (std::uint8_t& byte : input) byte = static_cast<std::uint8_t>(random());
    const ProgramResult result = run_program(input, protection);
    peers += result.peers;
    messages += result.messages_completed;
  }
  // They must reach behind the first check.
  EXPECT_GT(peers, static_cast<std::size_t>(programs) / 2);
  EXPECT_GT(messages, static_cast<std::uint64_t>(programs) / 4);
  testing::Test::RecordProperty("peers", std::to_string(peers));
  testing::Test::RecordProperty("messages", std::to_string(messages));
}

TEST(EndpointPrograms, SeededOnesKeepItsWord) { run_seeded(World::Protection::kClear, kPrograms); }

TEST(EndpointPrograms, SeededOnesOfInsidersKeepItsWord) {
  run_seeded(World::Protection::kSealed, kSealedPrograms);
}

}  // namespace
}  // namespace interneuron::fuzz::endpoint_test
