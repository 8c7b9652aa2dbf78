// One path by itself: when its probes leave.
#include "core/peers/path.h"

#include <gtest/gtest.h>

#include "pipe.h"

namespace interneuron::path_test {
namespace {

using peers::Path;

constexpr std::size_t kMaxDatagram = 1400;

TimePoint at(Duration d) { return TimePoint{d}; }

Path heard_path() {
  Path path(at(0s), LinkId{1}, {LinkId{0}, kMaxDatagram, {}}, address_of(1), {.connected = true});
  path.estimator.heard(at(0s));
  return path;
}

// A peer may claim any rate; a train at a thousand bits per second lasts longer than the pause
// after which the next one is due.
TEST(Path, ASlowTrainDoesNotKeepTheLoopAwake) {
  Path path = heard_path();
  path.estimator.train(at(0s), {1, 16, 16, 15 * 1428, DataRate{1000}, std::nullopt, {}});
  int packets = 0;
  for (TimePoint now = at(1s); now < at(60s);) {
    path.estimator.heard(now);
    path.refresh(now, true, {});
    while (path.heartbeat_due(now)) path.sent_feedback(now);
    while (path.probe_due(now)) {
      path.sent_probe(now, 1);
      ++packets;
    }
    path.estimator.handle_timeout(now);
    const TimePoint next = path.next_timeout(now);
    ASSERT_GT(next, now) << packets << " packets";
    now = next;
  }
  EXPECT_GE(packets, 16);
}

}  // namespace
}  // namespace interneuron::path_test
