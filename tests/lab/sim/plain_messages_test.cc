// Plain messages over emulated links: which variant is delivered, and what bulk leaves to others.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <vector>

#include "lab/emu/link.h"
#include "lab/emu/profile.h"
#include "lab/sim/world.h"

namespace interneuron::plain_messages_test {
namespace {

using namespace std::chrono_literals;

// A vehicle that sends to a roadside unit over links of so many Mbit/s.
struct Pair {
  sim::World world;
  sim::HostId vehicle = 0;
  sim::HostId road = 0;
  PeerId peer{};

  Pair(std::uint64_t seed, const std::vector<emu::LinkProfile>& links) : world(seed) {
    EndpointOptions options;
    options.policies = builtin_policies();
    options.session = SessionId{1};
    vehicle = world.add_host(options);
    options.session = SessionId{2};
    options.accept_peers = true;
    road = world.add_host(options);
    for (std::size_t i = 0; i < links.size(); ++i) {
      world.add_link(vehicle, road, LinkId{static_cast<std::uint16_t>(i)}, "l" + std::to_string(i),
                     emu::Link(links[i], emu::link_seed(seed, i)));
    }
    peer = world.connect(vehicle, road);
  }
  SendResult send(Variants variants, const SendOptions& options) {
    return world.endpoint(vehicle).send(world.local_time(vehicle), peer, std::move(variants),
                                        options);
  }
};

class OverLikeLinks : public ::testing::TestWithParam<std::tuple<std::string, std::string>> {};

TEST_P(OverLikeLinks, TheBestVariantIsDeliveredWhereItIsSent) {
  const auto& [link, policy] = GetParam();
  const emu::LinkProfile profile =
      link == "5g" ? *emu::built_in_profile("5g") : emu::constant_link("20 Mbit/s", 40, 20, 20);
  constexpr int kCount = 60;
  for (const std::uint64_t seed : {70'041U, 70'042U}) {
    Pair p(seed, {profile, profile});
    std::vector<int> variants;
    int fates = 0;
    p.world.on_event([&](sim::HostId host, Event&& e) {
      if (auto* m = std::get_if<Message>(&e); m != nullptr && host == p.road) {
        variants.push_back(m->variant);
      }
      if (auto* f = std::get_if<MessageFate>(&e); f != nullptr && host == p.vehicle) {
        fates += f->fate == Fate::kDelivered && f->variant == 0 ? 1 : 0;
      }
    });
    for (int i = 0; i < kCount; ++i) {
      p.world.at(3s + i * 100ms, [&] {
        p.send({Bytes(100 * 1024), Bytes(40 * 1024), Bytes(12 * 1024)},
               {.deadline = 250ms, .policy = policy});
        p.world.flush(p.vehicle);
      });
    }
    p.world.run_until(10s);
    EXPECT_EQ(variants.size(), kCount);
    EXPECT_GE(std::ranges::count(variants, 0), 58) << seed;
    EXPECT_EQ(fates, std::ranges::count(variants, 0)) << seed;
  }
}
INSTANTIATE_TEST_SUITE_P(Policies, OverLikeLinks,
                         ::testing::Combine(::testing::Values("5g", "20"),
                                            ::testing::Values("down_sampling", "joint", "placement",
                                                              "coded", "shadow", "stripe")));

// One kilobyte at 50 Hz over 20 Mbit/s, with and without as much bulk as there is room for.
struct Beside {
  double p99_ms = 0;
  double bulk_mbit = 0;
};

Beside urgent_beside_bulk(std::uint64_t seed, double rtt_ms, bool bulk) {
  constexpr Duration kFrom = 5s;
  constexpr Duration kTo = 20s;
  Pair p(seed, {emu::constant_link("l", rtt_ms, 20, 20)});
  std::vector<double> took;
  std::size_t bulk_bytes = 0;
  int under_way = 0;
  p.world.on_event([&](sim::HostId host, Event&& e) {
    if (auto* m = std::get_if<Message>(&e); m != nullptr && host == p.road) {
      const Duration now = p.world.now();
      if (now <= kFrom || now > kTo) return;
      if (m->channel == 2) bulk_bytes += m->bytes.size();
      if (m->channel == 1) took.push_back(to_ms(*m->age));
    }
    auto* f = std::get_if<MessageFate>(&e);
    if (f != nullptr && f->channel == 2) --under_way;
  });
  for (Duration t = 3s; t < kTo; t += 20ms) {
    p.world.at(t, [&] {
      EXPECT_TRUE(p.send({Bytes(1024)}, {.deadline = 300ms, .policy = "best_link", .channel = 1})
                      .accepted());
      p.world.flush(p.vehicle);
    });
    if (!bulk) continue;
    p.world.at(t + 1ms, [&] {
      for (; under_way < 16; ++under_way) {
        const SendOptions options{.policy = "best_link", .channel = 2, .bulk = true};
        if (!p.send({Bytes(64 * 1024)}, options).accepted()) break;
      }
      p.world.flush(p.vehicle);
    });
  }
  p.world.run_until(kTo + 1s);
  std::ranges::sort(took);
  EXPECT_GT(took.size(), 700U);
  return {took[took.size() * 99 / 100],
          static_cast<double>(bulk_bytes) * 8 / 1e6 / to_seconds(kTo - kFrom)};
}

TEST(Bulk, TakesWhatIsLeftAndWhatIsUrgentHardlyWaits) {
  for (const double rtt_ms : {20.0, 40.0}) {
    const Beside idle = urgent_beside_bulk(70'043, rtt_ms, false);
    const Beside busy = urgent_beside_bulk(70'043, rtt_ms, true);
    EXPECT_LE(busy.p99_ms, idle.p99_ms + 20) << rtt_ms;
    EXPECT_GE(busy.bulk_mbit, 0.8 * (20 - 0.5)) << rtt_ms;
  }
}

}  // namespace
}  // namespace interneuron::plain_messages_test
