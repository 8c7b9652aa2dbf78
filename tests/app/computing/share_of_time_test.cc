#include "app/computing/shares.h"

#include <gtest/gtest.h>

namespace interneuron::computing::share_of_time_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration t) { return TimePoint{t}; }

// Jobs of a peer every `interval` until `end`.
void stream(ShareOfTime& share, PeerId peer, Duration interval, Duration end) {
  for (Duration t{}; t <= end; t += interval) share.came(peer, at(t));
}

TEST(ShareOfTime, APeerAloneMayTakeAnyTime) {
  ShareOfTime share;
  EXPECT_EQ(share.longest(PeerId{1}, at(0ms)), Duration::max());
  stream(share, PeerId{1}, 10ms, 500ms);
  EXPECT_EQ(share.longest(PeerId{1}, at(500ms)), Duration::max());
}

TEST(ShareOfTime, WhoSendsMoreOftenMayTakeLess) {
  ShareOfTime share;
  stream(share, PeerId{1}, 100ms, 2s);
  stream(share, PeerId{2}, 10ms, 2s);
  EXPECT_EQ(share.longest(PeerId{1}, at(2s)), 50ms);
  EXPECT_EQ(share.longest(PeerId{2}, at(2s)), 5ms);
}

TEST(ShareOfTime, TheFirstJobIsNotBounded) {
  ShareOfTime share;
  share.came(PeerId{1}, at(0ms));
  share.came(PeerId{2}, at(0ms));
  EXPECT_EQ(share.longest(PeerId{1}, at(0ms)), Duration::max());
}

TEST(ShareOfTime, WhoIsSilentCountsNoLonger) {
  ShareOfTime share;
  stream(share, PeerId{1}, 100ms, 2s);
  stream(share, PeerId{2}, 100ms, 1s);
  EXPECT_EQ(share.active(at(2s)), 2u);
  EXPECT_EQ(share.active(at(2s + 1ns)), 1u);
  EXPECT_EQ(share.longest(PeerId{1}, at(2s + 1ns)), Duration::max());
  share.came(PeerId{2}, at(2100ms));
  EXPECT_EQ(share.active(at(2100ms)), 2u);
}

TEST(ShareOfTime, OneBurstDoesNotTakeTheShareAway) {
  ShareOfTime share;
  stream(share, PeerId{1}, 100ms, 2s);
  stream(share, PeerId{2}, 100ms, 2s);
  share.came(PeerId{1}, at(2s));
  share.came(PeerId{1}, at(2s));
  EXPECT_GT(share.longest(PeerId{1}, at(2s)), 35ms);
}

TEST(ShareOfTime, WhoIsForgottenCountsNoLonger) {
  ShareOfTime share;
  stream(share, PeerId{1}, 100ms, 1s);
  stream(share, PeerId{2}, 100ms, 1s);
  share.forget(PeerId{2});
  share.forget(PeerId{3});
  EXPECT_EQ(share.active(at(1s)), 1u);
  EXPECT_EQ(share.longest(PeerId{2}, at(1s)), Duration::max());
}

}  // namespace
}  // namespace interneuron::computing::share_of_time_test
