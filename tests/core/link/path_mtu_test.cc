#include "core/link/path_mtu.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace interneuron::link::path_mtu_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{1h + d}; }

// A path that carries `carries` bytes; what is lost of smaller probes is up to `lost`.
struct Searched {
  PathMtu mtu;
  std::size_t carries = 0;
  std::uint64_t number = 0;
  TimePoint now = at(0s);
  int probes = 0;
  explicit Searched(std::size_t most, std::size_t carried) : mtu(most), carries(carried) {
    mtu.set_ready(at(0s), true);
  }
  // Sends the probes that are due until `end`; each is told of 50 ms later.
  template <class Lost>
  void run(TimePoint end, const Lost& lost) {
    while (now < end) {
      mtu.handle_timeout(now);
      if (mtu.probe_due()) {
        const std::size_t size = mtu.probe_size();
        mtu.probe_sent(now, ++number);
        ++probes;
        now += 50ms;
        mtu.probe_told(size <= carries && !lost());
      }
      const TimePoint next = mtu.probe_due() ? now : mtu.next_timeout().value_or(end);
      now = std::max(now + 1ms, std::min(end, next));
    }
  }
  void run(Duration for_) {
    run(now + for_, [] { return false; });
  }
};

TEST(PathMtu, ThePathThatCarriesWhatTheNicDoesTakesOneProbe) {
  Searched s(1400, 1500);
  EXPECT_EQ(s.mtu.datagram(), PathMtu::kBase);
  s.run(100ms);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
  s.run(1h);
  EXPECT_EQ(s.probes, 1);
}

RC_GTEST_PROP(PathMtu, FindsWhatThePathCarriesAndNeverMore, ()) {
  const auto most = *rc::gen::inRange<std::size_t>(PathMtu::kBase, 1401);
  Searched s(most, *rc::gen::inRange<std::size_t>(PathMtu::kBase, 1500));
  for (int i = 0; i < 200; ++i) {
    s.run(100ms);
    RC_ASSERT(s.mtu.datagram() <= std::min(s.carries, most));
  }
  RC_ASSERT(s.mtu.datagram() + PathMtu::kStep >= std::min(s.carries, most));
  const int probes = s.probes;
  s.run(500s);
  RC_ASSERT(s.probes == probes);
}

RC_GTEST_PROP(PathMtu, NeverSaysMoreThanHasArrivedWhateverIsLost, ()) {
  Searched s(1400, *rc::gen::inRange<std::size_t>(PathMtu::kBase, 1500));
  const int percent = *rc::gen::inRange(0, 60);
  for (int i = 0; i < 60; ++i) {
    s.run(s.now + 1s, [&] { return *rc::gen::inRange(0, 100) < percent; });
    RC_ASSERT(s.mtu.datagram() >= PathMtu::kBase);
    RC_ASSERT(s.mtu.datagram() <= s.carries);
  }
}

TEST(PathMtu, AnOutageSaysNothingOfSizes) {
  PathMtu mtu(1400);
  mtu.set_ready(at(0s), true);
  TimePoint now = at(0s);
  for (int i = 0; i < 20; ++i, now += PathMtu::kProbeTimer) {
    mtu.handle_timeout(now);
    ASSERT_TRUE(mtu.probe_due());
    ASSERT_EQ(mtu.probe_size(), 1400U);
    mtu.probe_sent(now, static_cast<std::uint64_t>(i + 1));
  }
}

TEST(PathMtu, OneProbeLeavesBeforeThePeerAnswersAndItsLossSaysNothing) {
  PathMtu mtu(1400);
  ASSERT_TRUE(mtu.probe_due());
  mtu.probe_sent(at(0s), 1);
  mtu.probe_told(false);
  mtu.handle_timeout(at(10s));
  EXPECT_FALSE(mtu.probe_due());
  EXPECT_FALSE(mtu.next_timeout());
  mtu.set_ready(at(0s), true);
  for (std::uint64_t n = 2; n < 5; ++n) {
    ASSERT_TRUE(mtu.probe_due());
    EXPECT_EQ(mtu.probe_size(), 1400U);
    mtu.probe_sent(at(10s * n), n);
    mtu.probe_told(false);
    mtu.handle_timeout(at(10s * n + 1s));
  }
  EXPECT_EQ(mtu.probe_size(), 1300U);
}

TEST(PathMtu, ASmallerSizeIsTriedAgainAfterTenMinutes) {
  Searched s(1400, 1300);
  s.run(30s);
  EXPECT_LE(s.mtu.datagram(), 1300U);
  s.carries = 1500;
  s.run(500s);
  EXPECT_LE(s.mtu.datagram(), 1300U);
  s.run(200s);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
}

TEST(PathMtu, ANicOfLessThanTheBaseIsTakenAtItsWord) {
  Searched s(1000, 1500);
  s.run(10s);
  EXPECT_EQ(s.mtu.datagram(), 1000U);
  EXPECT_EQ(s.probes, 0);
}

// --- black holes

struct BlackHole : testing::Test {
  BlackHole() { s.run(100ms); }
  void lose(Duration from, Duration to, int packets) {
    PathMtu::Told told;
    for (int i = 0; i < packets; ++i) told.lost(at(from + (to - from) * i / (packets - 1)));
    s.mtu.packets_told(told);
  }
  void arrive(Duration sent, bool large) {
    PathMtu::Told told;
    told.arrived(at(sent), large);
    s.mtu.packets_told(told);
  }
  Searched s{1400, 1500};
};

TEST_F(BlackHole, EndsInTheBaseAndInAnotherSearch) {
  ASSERT_EQ(s.mtu.datagram(), 1400U);
  lose(1s, 1s + 20ms, 5);
  arrive(1s + 30ms, false);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
  lose(1s + 90ms, 1s + 100ms, 2);
  EXPECT_EQ(s.mtu.datagram(), PathMtu::kBase);
  s.carries = 1300;
  s.run(30s);
  EXPECT_GT(s.mtu.datagram(), 1300U - PathMtu::kStep);
  EXPECT_LE(s.mtu.datagram(), 1300U);
}

TEST_F(BlackHole, IsNoneWhereALargePacketArrives) {
  lose(1s, 1s + 20ms, 5);
  arrive(1s + 30ms, false);
  arrive(1s + 40ms, true);
  lose(1s + 90ms, 1s + 100ms, 2);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
}

TEST_F(BlackHole, IsNoOutage) {
  lose(1s, 1s + 500ms, 100);
  // What arrives has left after all that was lost.
  arrive(1s + 510ms, false);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
}

TEST_F(BlackHole, IsNoFullQueue) {
  // A burst that found no room, and a small packet that did.
  lose(1s, 1s + 20ms, 30);
  arrive(1s + 10ms, false);
  EXPECT_EQ(s.mtu.datagram(), 1400U);
}

}  // namespace
}  // namespace interneuron::link::path_mtu_test
