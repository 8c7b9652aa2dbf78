// Whose turn it is to send.
#include "core/peers/turns.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>

namespace interneuron::turns_test {
namespace {

using peers::Turns;

constexpr LinkId kFirst{0};
constexpr LinkId kSecond{200};
constexpr std::size_t kFull = kMaxPacketBytes;

TEST(Turns, FeedbackComesInTheOrderInWhichPeersWereAdded) {
  Turns turns;
  EXPECT_FALSE(turns.feedback());
  for (const Turns::Slot peer : {5U, 2U, 5U, 9U}) turns.add(peer);
  for (const Turns::Slot peer : {5U, 2U, 9U}) {
    EXPECT_EQ(turns.feedback(), peer);
    turns.feedback_done();
  }
  EXPECT_FALSE(turns.feedback());
}

TEST(Turns, NicsAlternateWhateverTheirNumbers) {
  Turns turns;
  turns.add(1, kFirst);
  turns.add(1, kSecond);
  std::map<LinkId, int> packets;
  for (int i = 0; i < 100; ++i) {
    const auto turn = turns.data();
    ASSERT_TRUE(turn);
    ++packets[turn->nic];
    turns.sent(kFull);
    // Every call of the user's loop may be its last one for now.
    turns.data();
  }
  EXPECT_EQ(packets[kFirst], 50);
  EXPECT_EQ(packets[kSecond], 50);
}

TEST(Turns, WhoHasNothingMoreLeavesAndMayComeBack) {
  Turns turns;
  turns.add(1, kFirst);
  turns.add(2, kFirst);
  ASSERT_EQ(turns.data()->peer, 1U);
  turns.done();
  ASSERT_EQ(turns.data()->peer, 2U);
  turns.done();
  EXPECT_FALSE(turns.data());
  turns.add(1, kFirst);
  EXPECT_EQ(turns.data()->peer, 1U);
}

TEST(Turns, WhoIsForgottenHasNoTurn) {
  Turns turns;
  for (const Turns::Slot peer : {1U, 2U, 3U}) {
    turns.add(peer);
    turns.add(peer, kFirst);
  }
  turns.forget(1);
  EXPECT_EQ(turns.feedback(), 2U);
  EXPECT_EQ(turns.data()->peer, 2U);
  turns.forget(2);
  turns.forget(3);
  EXPECT_FALSE(turns.feedback());
  EXPECT_FALSE(turns.data());
}

// Peers that always have something get the same bytes over a NIC, whatever the sizes of their
// packets: they differ by no more than a turn and a packet.
RC_GTEST_PROP(Turns, AreFairInBytes, ()) {
  const auto sizes =
      *rc::gen::container<std::vector<std::size_t>>(rc::gen::inRange<std::size_t>(40, kFull + 1));
  if (sizes.empty()) return;
  Turns turns;
  for (Turns::Slot peer = 0; peer < sizes.size(); ++peer) turns.add(peer, kFirst);
  std::vector<std::size_t> bytes(sizes.size());
  const int packets = *rc::gen::inRange(1, 2000);
  for (int i = 0; i < packets; ++i) {
    const auto turn = turns.data();
    RC_ASSERT(turn.has_value());
    bytes[turn->peer] += sizes[turn->peer];
    turns.sent(sizes[turn->peer]);
  }
  const auto [least, most] = std::ranges::minmax(bytes);
  RC_ASSERT(most - least <= static_cast<std::size_t>(Turns::kQuantum) + kFull);
}

}  // namespace
}  // namespace interneuron::turns_test
