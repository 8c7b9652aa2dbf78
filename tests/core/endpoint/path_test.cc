// One path by itself: when its probes leave.
#include "core/peers/path.h"

#include <gtest/gtest.h>

#include "pipe.h"

namespace interneuron {
namespace {

constexpr std::size_t kMaxDatagram = 1400;

TimePoint at(Duration d) { return TimePoint{d}; }

Path heard_path(bool trusted) {
  Path path(at(0s), LinkId{1}, {LinkId{0}, kMaxDatagram, {}}, address_of(1), trusted);
  path.estimator.heard(at(0s));
  return path;
}

// A peer may claim any rate; a train at a thousand bits per second lasts longer than the pause
// after which the next one is due.
TEST(Path, ASlowTrainDoesNotKeepTheLoopAwake) {
  Path path = heard_path(true);
  path.estimator.train(at(0s), {1, 16, 16, 15 * 1428, DataRate{1000}, std::nullopt, {}});
  int packets = 0;
  for (TimePoint now = at(1s); now < at(60s);) {
    path.estimator.heard(now);
    path.refresh(now, true, {});
    while (path.heartbeat_due(now)) path.sent_feedback(now, 100);
    while (path.probe_due(now)) {
      path.sent_probe(now, kMaxDatagram, 1);
      ++packets;
    }
    path.estimator.handle_timeout(now);
    const TimePoint next = path.next_timeout(now);
    ASSERT_GT(next, now) << packets << " packets";
    now = next;
  }
  EXPECT_GE(packets, 16);
}

// RFC 9000 §8.1: whoever has not echoed us may be somebody else's address.
TEST(Path, ProofsRespectWhatAnUnknownAddressMayGet) {
  Path path = heard_path(false);
  path.received(500);
  TimePoint now = at(0s);
  // It is heard, but nothing of ours arrives.
  for (; path.estimator.path() != PathState::kLatched; now += 10ms) {
    ASSERT_LT(now, at(10s));
    path.estimator.sent(now, true);
    path.estimator.heard(now);
    path.estimator.handle_timeout(now);
  }
  int packets = 0;
  for (const TimePoint end = now + 10s; now < end; now += 10ms) {
    path.estimator.heard(now);
    path.refresh(now, true, {});
    while (path.probe_due(now)) {
      path.sent_probe(now, kMaxDatagram, 1);
      ++packets;
    }
    if (path.estimator.path() != PathState::kLatched) break;
  }
  EXPECT_EQ(path.estimator.path(), PathState::kLatched);
  EXPECT_EQ(packets, 1) << "three times 500 bytes";
}

}  // namespace
}  // namespace interneuron
