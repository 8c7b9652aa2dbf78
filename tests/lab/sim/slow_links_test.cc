// Links of 0.1 to 2 Mbit/s, on which feedback, heartbeats and copies of results may take more than
// what is asked for.
#include <cstdio>
#include <map>

#include "core/wire/header.h"
#include "lab/sim/duo.h"
#include "lab/sim/trust.h"
#include "support.h"

namespace interneuron::sim::slow_links_test {
namespace {

// A link of a round trip of 40 ms whose queues are as long as those of base stations.
emu::LinkProfile slow(const char* name, double up_mbit, double down_mbit) {
  emu::LinkProfile out = constant_link(name, 40, up_mbit, down_mbit);
  for (emu::DirectionParams* direction : {&out.up, &out.down}) {
    const double bits = static_cast<double>(direction->rate.bits_per_second);
    direction->queue_bytes =
        static_cast<std::size_t>(bits / 8 * to_seconds(emu::kDefaultQueueTime));
  }
  return out;
}

struct Figures {
  std::uint32_t missed = 0;
  // Of the bytes that the roadside unit sent, with IP headers.
  double results = 0;
};

// The ladder of JPEGs at 10 Hz, encrypted, deadline 250 ms.
Figures run(const std::vector<emu::LinkProfile>& links, std::uint64_t seed) {
  OffloadOptions o;
  o.seed = seed;
  o.deadline = 250ms;
  o.profiles = links;
  o.policy = "joint";
  o.guard = GuardKind::kBudget;
  o.fallback.local = 0.14;
  o.ladder = jpeg_ladder();
  o.variant_bytes.assign(kJpegBytes.begin(), kJpegBytes.end());
  o.hosts.encode = kJpegEncode;
  o.is_encrypted = true;
  std::uint64_t all = 0;
  std::uint64_t of_results = 0;
  const OffloadResult r = run_offload(o, [&](World& world) {
    world.on_sent([&](HostId host, LinkId, ByteView datagram) {
      // The vehicle is host 0; while links are measured at first there are no results.
      if (host == 0 || world.now() < kWarmUp) return;
      all += datagram.size() + kIpUdpBytes;
      const auto header = wire::peek(datagram);
      const bool is_data = header && header->type == wire::PacketType::kData;
      if (is_data) of_results += datagram.size() + kIpUdpBytes;
    });
  });
  const Figures out{o.rounds - r.on_time(),
                    static_cast<double>(of_results) / static_cast<double>(all)};
  std::printf("seed %llu, %zu links of %.2f/%.2f Mbit/s: %u of %u missed, %.1f %% results\n",
              static_cast<unsigned long long>(seed), links.size(),
              static_cast<double>(links[0].up.rate.bits_per_second) / 1e6,
              static_cast<double>(links[0].down.rate.bits_per_second) / 1e6, out.missed, o.rounds,
              100 * out.results);
  return out;
}

TEST(SlowLinks, OneBringsImagesAndResults) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Figures f = run({slow("a", 1.4, 0.35)}, seed);
    EXPECT_LE(f.missed, 6U) << seed;
    EXPECT_GE(f.results, 0.8) << seed;
  }
}

TEST(SlowLinks, TwoDoNotCarryTheSameResults) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Figures f = run({slow("a", 1.44, 0.36), slow("b", 1.44, 0.36)}, seed);
    EXPECT_LE(f.missed, 3U) << seed;
    EXPECT_GE(f.results, 0.8) << seed;
  }
}

EndpointOptions options(int key, int other) {
  EndpointOptions out;
  out.security = security_of(key, {other});
  return out;
}

// Counts what becomes of messages.
class Fates final : public Duo {
 public:
  using Duo::Duo;
  std::map<Fate, std::size_t> fates;

 protected:
  void handle(HostId host, Event&& event) override {
    if (const auto* fate = std::get_if<MessageFate>(&event)) ++fates[fate->fate];
    Duo::handle(host, std::move(event));
  }
};

// A message of 200 bytes each second, for a minute.
TEST(SlowLinks, ATenthOfAMegabitBringsSmallMessagesAndTheirFates) {
  constexpr std::size_t kMessages = 60;
  for (const double mbit : {0.1, 0.2, 0.5}) {
    for (const Duration deadline : {Duration(250ms), Duration(1s)}) {
      Fates s({slow("a", mbit, mbit)},
              {.variants = {200}, .deadline = deadline, .period = 1s, .seed = 1}, options(1, 2),
              options(2, 1));
      s.send(Duo::kBegin, kMessages);
      s.run();
      const std::size_t told = s.fates[Fate::kDelivered];
      std::printf("%.1f Mbit/s, %.0f ms: %zu of %zu missed, %zu known to be delivered\n", mbit,
                  to_ms(deadline), s.missed(), kMessages, told);
      EXPECT_EQ(s.missed(), 0U);
      EXPECT_EQ(told, kMessages);
      EXPECT_EQ(s.link(0).path, PathState::kOk);
      EXPECT_LT(s.link(0).age, 500ms);
    }
  }
}

}  // namespace
}  // namespace interneuron::sim::slow_links_test
