// Failures of bonded links that users of other transports report, each named after a thread that
// tells of it, over links in virtual time.
#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::field_failures_test {
namespace {

constexpr LinkId kFast{0};
constexpr LinkId kSlow{1};

std::vector<emu::LinkProfile> two_links() {
  return {constant_link("fast", 30, 60, 60), constant_link("slow", 60, 20, 20)};
}

// 13 s of 128 KiB and a quarter of that at 10 Hz, with what happens to the links between 4 s and
// 9 s.
struct Drive : Duo {
  explicit Drive(const char* policy, const std::vector<emu::LinkProfile>& links = two_links())
      : Duo(links, {.policy = policy, .variants = {128 * 1024, 32 * 1024}}) {
    send(2s, 130);
  }
  // How many of the messages sent in [from, to) were missed.
  std::size_t missed_between(Duration from, Duration to) const {
    return missed(static_cast<std::size_t>((from - 2s) / 100ms),
                  static_cast<std::size_t>((to - 2s) / 100ms));
  }
  std::uint64_t bytes_over(LinkId link) const { return world.stats(link, true).bytes_in; }
  void run_to(Duration end) { world.run_until(end); }
};

// A card is set down and up again (`ip link set`), and the group of bonded links refuses to
// transmit from then on (Haivision/srt issue 2824).
TEST(FieldFailures, HaivisionSrt2824ACardThatGoesDownAndUpCarriesMessagesAgain) {
  Drive d("coded");
  d.world.outage(d.world.wire_of(kFast), 4s, 5s);
  d.run_to(10s);
  const std::uint64_t before = d.bytes_over(kFast);
  d.run_to(12s);
  EXPECT_GT(d.bytes_over(kFast), before + 2'000'000U);
  d.run();
  EXPECT_LE(d.missed(), 1U);
}

// Main and backup drop packets when they switch back (Haivision/srt issue 1757).
TEST(FieldFailures, HaivisionSrt1757TheSwitchBackDropsNothing) {
  for (const char* policy : {"coded", "stripe", "shadow", "failover"}) {
    Drive d(policy);
    d.world.outage(d.world.wire_of(kFast), 4s, 5s);
    d.run();
    EXPECT_EQ(d.missed_between(5s, 15s), 0U) << policy;
  }
}

// A link that is back is used less than before (multipath-tcp/mptcp_net-next issue 581).
TEST(FieldFailures, MptcpNetNext581ALinkThatIsBackHasItsShareTwoSecondsLater) {
  Drive d("coded");
  d.run_to(3s);
  const std::uint64_t start = d.bytes_over(kFast);
  d.run_to(4s);
  const std::uint64_t usual = d.bytes_over(kFast) - start;
  d.world.outage(d.world.wire_of(kFast), 4s, 5s);
  d.run_to(11s);
  const std::uint64_t back = d.bytes_over(kFast);
  d.run_to(12s);
  EXPECT_GE(d.bytes_over(kFast) - back, usual * 9 / 10);
}

// Round trips rise without a loss, and the link goes on being fed until it recovers much later
// (mp0rta/mqvpn issue 73).
TEST(FieldFailures, Mqvpn73ASpikeOfTheRoundTripIsGoneRound) {
  for (const char* policy : {"coded", "stripe"}) {
    Drive d(policy);
    d.world.delay_with([&d](HostId host, const LeavingPacket& packet) {
      const bool spike = d.world.now() >= 4s && d.world.now() < 6s;
      return spike && host == d.vehicle && packet.link == kFast ? Duration(250ms)
                                                                : Duration::zero();
    });
    d.run_to(8s);
    const std::uint64_t before = d.bytes_over(kFast);
    d.run_to(10s);
    EXPECT_GT(d.bytes_over(kFast), before + 1'000'000U) << policy;
    d.run();
    EXPECT_LE(d.missed(), 2U) << policy;
    EXPECT_EQ(d.missed_between(7s, 15s), 0U) << policy;
  }
}

// A path that is a black hole takes the connection with it, or 10 s (cloudflare/quiche issue 1310).
TEST(FieldFailures, Quiche1310ABlackHoleTakesNothingWithIt) {
  for (const LinkId link : {kFast, kSlow}) {
    Drive d("coded");
    d.world.outage(d.world.wire_of(link), 4s, 60s);
    d.run();
    EXPECT_LE(d.missed(), 1U);
    EXPECT_LE(d.degraded(), 2U);
  }
}

// A cable is unplugged: errors of send() until the application's own timeout
// (private-octopus/picoquic issue 1951).
TEST(FieldFailures, Picoquic1951ACableThatIsUnpluggedCostsNoMessage) {
  for (int step = 0; step < 10; ++step) {
    Drive d("stripe");
    d.world.at(4s + step * 10ms, [&d] {
      d.world.endpoint(d.vehicle).remove_link(d.world.local_time(d.vehicle), kFast);
      d.world.faults(kFast).cut = true;
      d.world.flush(d.vehicle);
    });
    d.run();
    EXPECT_EQ(d.missed(), 0U) << step;
  }
}

// A carrier reorders IP packets above 1440 bytes, which looks like loss (quic-go/quic-go issue
// 5768). None of ours is so large.
TEST(FieldFailures, QuicGo5768NoPacketIsLargeEnoughToBeReordered) {
  auto links = two_links();
  for (emu::LinkProfile& link : links) {
    link.nat.reorder_above = 1440;
    link.nat.reorder = 0.03;
    link.nat.reorder_delay = 10ms;
  }
  Drive d("coded", links);
  d.run();
  EXPECT_EQ(d.missed(), 0U);
  EXPECT_EQ(d.world.stats(kFast, true).reordered, 0U);
  EXPECT_EQ(d.world.endpoint(d.vehicle).link_counters(kFast).fragments_lost, 0U);
}

// Carriers' NATs drop tiny control packets (OpenIRL/srtla pull request 5).
TEST(FieldFailures, Srtla5NoControlPacketIsTinyEnoughToBeDropped) {
  auto links = two_links();
  // With 32 bytes of UDP payload.
  for (emu::LinkProfile& link : links) link.nat.drop_below = 60;
  Drive d("coded", links);
  d.run();
  EXPECT_EQ(d.missed(), 0U);
  EXPECT_EQ(d.world.stats(kFast, true).nat_drops, 0U);
  EXPECT_EQ(d.world.stats(kSlow, false).nat_drops, 0U);
}

// A modem more makes the upload worse (Ysurac/openmptcprouter issue 4259).
TEST(FieldFailures, OpenMptcpRouter4259ASlowModemMoreCostsNothing) {
  for (const char* policy : {"coded", "stripe"}) {
    Drive d(policy, {constant_link("fast", 30, 35, 35), constant_link("slow", 80, 6, 6)});
    d.run();
    EXPECT_EQ(d.missed(), 0U) << policy;
    EXPECT_EQ(d.degraded(), 0U) << policy;
  }
}

}  // namespace
}  // namespace interneuron::sim::field_failures_test
