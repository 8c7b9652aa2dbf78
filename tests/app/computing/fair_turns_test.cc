#include "app/computing/shares.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>
#include <vector>

namespace interneuron::computing::fair_turns_test {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;

// Serves whoever's turn it is for `took`; returns who that was.
PeerId serve(FairTurns& turns, Duration took) {
  const PeerId peer = *turns.next();
  turns.begin(peer);
  turns.charge(peer, took);
  return peer;
}

TEST(FairTurns, NobodyIsNextAtFirst) {
  FairTurns turns;
  EXPECT_FALSE(turns.next());
  turns.want(PeerId{1});
  EXPECT_EQ(turns.next(), PeerId{1});
  turns.rest(PeerId{1});
  EXPECT_FALSE(turns.next());
}

TEST(FairTurns, EqualsAreServedInTheOrderInWhichTheyWanted) {
  FairTurns turns;
  for (const std::uint32_t peer : {5U, 2U, 9U}) turns.want(PeerId{peer});
  for (const std::uint32_t peer : {5U, 2U, 9U}) EXPECT_EQ(serve(turns, 1ms), PeerId{peer});
}

TEST(FairTurns, WhoTakesTenTimesAsLongHasATenthOfTheTurns) {
  FairTurns turns;
  turns.want(PeerId{1});
  turns.want(PeerId{2});
  std::map<PeerId, int> turns_of;
  for (int i = 0; i < 110; ++i) {
    ++turns_of[serve(turns, *turns.next() == PeerId{1} ? 10ms : 1ms)];
  }
  EXPECT_NEAR(turns_of[PeerId{1}], 10, 1);
}

TEST(FairTurns, APauseIsNoClaim) {
  FairTurns turns;
  turns.want(PeerId{1});
  for (int i = 0; i < 1000; ++i) serve(turns, 10ms);
  turns.want(PeerId{2});
  Duration second{};
  for (int i = 0; i < 100; ++i) {
    if (serve(turns, 10ms) == PeerId{2}) second += 10ms;
  }
  EXPECT_LE(second, 510ms);
}

TEST(FairTurns, WhoTookLessThanItsPartIsNext) {
  FairTurns turns;
  turns.want(PeerId{1});
  turns.want(PeerId{2});
  turns.want(PeerId{3});
  for (int i = 0; i < 30; ++i) serve(turns, 10ms);
  turns.rest(PeerId{3});
  for (int i = 0; i < 4; ++i) serve(turns, 10ms);
  turns.want(PeerId{3});
  EXPECT_EQ(turns.next(), PeerId{3});
}

TEST(FairTurns, AJobOfAPeerThatIsGoneIsChargedToNobody) {
  FairTurns turns;
  turns.want(PeerId{1});
  turns.begin(PeerId{1});
  turns.forget(PeerId{1});
  turns.charge(PeerId{1}, 1h);
  EXPECT_EQ(turns.wanting(), 0u);
  turns.want(PeerId{1});
  turns.want(PeerId{2});
  EXPECT_EQ(turns.next(), PeerId{1}) << "it owes nothing";
}

// Peer 0 wants all the time, the others come and go as they like and take as long as they like.
RC_GTEST_PROP(FairTurns, NobodyWithDemandGetsLessThanItsPartMinusOneJob, ()) {
  const auto others = *rc::gen::inRange<std::uint32_t>(1, 8);
  FairTurns turns;
  // The service that peer 0 finds when it comes must not count.
  for (std::uint32_t i = 1; i <= others; ++i) turns.want(PeerId{i});
  const auto before = *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 60));
  for (const int took : before) serve(turns, milliseconds(took));

  turns.want(PeerId{0});
  const auto steps = *rc::gen::container<std::vector<std::pair<int, std::uint32_t>>>(
      rc::gen::pair(rc::gen::inRange(0, 60), rc::gen::inRange<std::uint32_t>(0, 3 * others)));
  std::map<PeerId, Duration> served;
  Duration all{};
  Duration longest{};
  for (const auto& [took, who] : steps) {
    const PeerId other{1 + who % others};
    if (who < others) turns.rest(other);
    if (who >= 2 * others) turns.want(other);
    served[serve(turns, milliseconds(took))] += milliseconds(took);
    all += milliseconds(took);
    longest = std::max<Duration>(longest, milliseconds(took));
    RC_ASSERT(served[PeerId{0}] >= all / (others + 1) - longest);
  }
}

}  // namespace
}  // namespace interneuron::computing::fair_turns_test
