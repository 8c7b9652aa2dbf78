// Links and paths of different MTUs.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cstdio>

#include "core/link/path_mtu.h"
#include "core/wire/packet.h"
#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::mtu_test {
namespace {

// Rates in Mbit/s, `mtu` of the path in both directions.
emu::LinkProfile mtu_link(const char* name, double rtt_ms, double mbit, std::size_t mtu = 0,
                          double loss = 0) {
  emu::LinkProfile p = constant_link(name, rtt_ms, mbit, mbit, loss);
  p.up.mtu = p.down.mtu = mtu;
  return p;
}

// The largest packets that the vehicle has sent over each link, in IP bytes.
struct Largest {
  explicit Largest(World& world, HostId vehicle) {
    world.on_sent([this, &world, vehicle](HostId host, LinkId link, ByteView bytes) {
      if (host != vehicle) return;
      const auto packet = wire::parse(bytes);
      const std::size_t size = bytes.size() + kIpUdpBytes;
      const bool is_data = packet && packet->header.type == wire::PacketType::kData;
      if (is_data) data[link] = std::max(data[link], size);
      if (world.now() >= from) any[link] = std::max(any[link], size);
    });
  }
  std::map<LinkId, std::size_t> data;
  // Since `from`.
  std::map<LinkId, std::size_t> any;
  Duration from{};
};

TEST(Mtu, APathOf1380BehindANicOf1500LosesNothing) {
  for (const char* policy : {"best_link", "duplicate", "down_sampling"}) {
    for (const bool alone : {true, false}) {
      std::vector<emu::LinkProfile> links{mtu_link("a", 30, 60, 1380)};
      if (!alone) links.push_back(mtu_link("b", 60, 20));
      Duo s(links, {.policy = policy});
      Largest largest(s.world, s.vehicle);
      s.send(1s, 200);
      s.run();
      EXPECT_EQ(s.missed(), 0U) << policy << (alone ? ", alone" : "");
      EXPECT_LE(largest.data[LinkId{0}], 1380U);
      EXPECT_GT(largest.data[LinkId{0}], 1380U - link::PathMtu::kStep);
      std::printf("%-13s %s: %zu of 200 missed, packets of up to %zu bytes\n", policy,
                  alone ? "alone " : "beside", s.missed(), largest.data[LinkId{0}]);
    }
  }
}

TEST(Mtu, LinksOf1500And1300) {
  for (const char* policy : {"best_link", "duplicate", "split"}) {
    Duo s({mtu_link("a", 30, 60), mtu_link("b", 36, 60)},
          {.policy = policy, .deadline = 300ms, .period = 300ms, .nic_mtus = {1500, 1300}});
    Largest largest(s.world, s.vehicle);
    s.send(1s, 30);
    // The first link falls silent in the middle of a message, and comes back.
    const Duration silent = 1s + 10 * 300ms + 10ms;
    s.world.at(silent, [&] { s.world.faults(LinkId{0}).cut = true; });
    s.world.at(silent + 2s, [&] { s.world.faults(LinkId{0}).cut = false; });
    s.run();
    EXPECT_EQ(s.missed(), 0U) << policy;
    EXPECT_EQ(s.world.above_nic_mtu(), 0U);
    EXPECT_LE(largest.data[LinkId{1}], 1300U);
    std::printf("%-13s %zu of 30 missed\n", policy, s.missed());
  }
}

TEST(Mtu, APathThatShrinksIsABlackHoleForASecondAtMost) {
  Duo s({mtu_link("a", 30, 60)}, {.variants = {32 * 1024}});
  s.send(1s, 100);
  s.world.at(5s + 10ms, [&] {
    const std::vector<std::string> keys{"mtu=1300"};
    const auto smaller = emu::parse_change(keys);
    ASSERT_TRUE(std::holds_alternative<emu::LinkChange>(smaller));
    s.world.change(s.world.wire_of(LinkId{0}), std::get<emu::LinkChange>(smaller));
  });
  s.run();
  std::printf("%zu of 100 missed\n", s.missed());
  EXPECT_LE(s.missed(), 5U);
  EXPECT_EQ(s.missed(50), 0U);
}

// No packet above the NIC's MTU ever, no piece of a message above the path's, and nothing at all
// once the search has ended.
RC_GTEST_PROP(Mtu, NoPacketIsLargerThanItsPathOnceThatIsKnown, ()) {
  const auto links = *rc::gen::inRange<std::size_t>(1, 4);
  std::vector<emu::LinkProfile> profiles;
  std::vector<std::size_t> nics;
  std::vector<std::size_t> paths;
  for (std::size_t i = 0; i < links; ++i) {
    paths.push_back(*rc::gen::inRange<std::size_t>(1248, 1501));
    nics.push_back(*rc::gen::inRange<std::size_t>(1280, 1501));
    profiles.push_back(mtu_link("l", *rc::gen::inRange(4, 100), *rc::gen::inRange(3, 100), paths[i],
                                *rc::gen::inRange(0, 4) / 100.0));
  }
  Duo s(profiles, {.policy = *rc::gen::element<std::string>("best_link", "duplicate", "split"),
                   .variants = {*rc::gen::inRange<std::size_t>(100, 40'000)},
                   .nic_mtus = nics,
                   .seed = *rc::gen::inRange<std::uint64_t>(1, 1000)});
  Largest largest(s.world, s.vehicle);
  // Three sizes that are too large take three seconds each, and a loss by chance one more.
  largest.from = 25s;
  s.send(500ms, 300);
  s.run();
  RC_ASSERT(s.world.above_nic_mtu() == 0U);
  for (std::size_t i = 0; i < links; ++i) {
    const LinkId id{static_cast<std::uint8_t>(i)};
    RC_ASSERT(largest.data[id] <= paths[i]);
    RC_ASSERT(largest.any[id] <= std::min(paths[i], nics[i]));
  }
}

}  // namespace
}  // namespace interneuron::sim::mtu_test
