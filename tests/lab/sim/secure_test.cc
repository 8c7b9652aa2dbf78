// Encryption costs no message: neither where keys are renewed, nor where a carrier gives a vehicle
// another address in the middle of one.
#include <cstdio>
#include <map>

#include "echo_duo.h"

namespace interneuron::sim::secure_test {
namespace {

constexpr int kMessages = 40;
constexpr Duration kFirst = 1s;

PipelineConfig with(const char* policy) {
  PipelineConfig pipeline = EchoDuo::best_link();
  pipeline.policy = policy;
  return pipeline;
}

// Messages of 100 KB every 100 ms from `first` on; the address of the faster link changes at
// `rebound`.
int missed(const char* policy, bool is_encrypted, std::optional<Duration> rebound, Duration first,
           int messages, int* handshakes = nullptr) {
  EchoDuo duo({constant_link("a", 30, 60, 60), constant_link("b", 50, 40, 40)}, 1, {}, with(policy),
              {}, is_encrypted);
  duo.stream(first, messages, 100'000);
  if (rebound) duo.world.at(*rebound, [&] { duo.world.rebind(duo.vehicle, LinkId{0}); });
  if (handshakes != nullptr) {
    duo.world.on_sent([handshakes](HostId, LinkId, ByteView bytes) {
      const auto header = wire::peek(bytes);
      *handshakes += header && header->type == wire::PacketType::kResponse ? 1 : 0;
    });
  }
  duo.world.run_until(first + messages * Duration{100ms} + 1s);
  EXPECT_TRUE(duo.link(0).up);
  EXPECT_EQ(duo.done.size(), static_cast<std::size_t>(messages));
  return messages - duo.on_time();
}

// How many packets of each round leave the vehicle, as its endpoint says beside them.
std::map<RoundId, int> packets_by_round(bool is_encrypted) {
  EchoDuo duo({constant_link("a", 30, 60, 60)}, 1, {}, EchoDuo::best_link(), {}, is_encrypted);
  std::map<RoundId, int> packets;
  duo.world.delay_with([&](HostId host, const LeavingPacket& leaving) {
    const auto packet = wire::parse(leaving.bytes);
    if (packet) {
      EXPECT_EQ(leaving.round.has_value(), packet->header.type == wire::PacketType::kData);
    }
    if (host == duo.vehicle && leaving.round) ++packets[leaving.round->round];
    return Duration{};
  });
  duo.stream(kFirst, 3, 100'000);
  duo.world.run_until(kFirst + 1s);
  EXPECT_EQ(duo.on_time(), 3);
  return packets;
}

TEST(Secure, ThePacketsOfARoundAreKnownWithoutReadingThem) {
  const auto clear = packets_by_round(false);
  EXPECT_EQ(clear.size(), 3U);
  for (const auto& [round, packets] : clear) {
    EXPECT_GE(packets, 100'000 / static_cast<int>(kMaxDatagramBytes)) << round.value;
  }
  EXPECT_EQ(packets_by_round(true), clear);
}

class Rebinding : public testing::TestWithParam<const char*> {};

TEST_P(Rebinding, InTheMiddleOfAMessageCostsNoMoreThanInTheClear) {
  const bool is_duplicate = std::string_view(GetParam()) == "duplicate";
  int clear = 0;
  int sealed = 0;
  for (int phase = 0; phase < 40; ++phase) {
    const Duration at = kFirst + 2s + phase * 2'500us;
    const int before = missed(GetParam(), false, at, kFirst, kMessages);
    const int after = missed(GetParam(), true, at, kFirst, kMessages);
    EXPECT_LE(after, before + (is_duplicate ? 0 : 1)) << phase;
    clear += before;
    sealed += after;
  }
  std::printf("%s: %d of %d messages missed in the clear, %d encrypted\n", GetParam(), clear,
              40 * kMessages, sealed);
}

TEST_P(Rebinding, NorDoesARenewalOfTheKeysEvenAtTheSameTime) {
  // The keys are renewed between 120 s and 130 s after the first.
  constexpr Duration kBefore = 119s;
  constexpr int kLong = 120;
  int handshakes = 0;
  EXPECT_EQ(missed(GetParam(), true, std::nullopt, kBefore, kLong, &handshakes), 0);
  EXPECT_EQ(handshakes, 4);
  for (int phase = 0; phase < 10; ++phase) {
    EXPECT_LE(missed(GetParam(), true, 120s + phase * 1'003ms, kBefore, kLong),
              std::string_view(GetParam()) == "duplicate" ? 0 : 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Secure, Rebinding, testing::Values("duplicate", "best_link", "stripe"),
                         [](const auto& p) { return std::string(p.param); });

}  // namespace
}  // namespace interneuron::sim::secure_test
