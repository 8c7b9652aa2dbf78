#include "core/base/round_ring.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <vector>

namespace interneuron::round_ring_test {
namespace {

TEST(RoundRing, HoldsNothingAtFirst) {
  RoundRing<int> ring;
  // Also not round 0, though that is what an empty slot says.
  EXPECT_EQ(ring.find(RoundId{0}), nullptr);
  EXPECT_EQ(ring.find(RoundId{64}), nullptr);
}

TEST(RoundRing, KeepsWhatEntered) {
  RoundRing<int> ring;
  *ring.enter(RoundId{5}) = 7;
  EXPECT_EQ(*ring.find(RoundId{5}), 7);
  EXPECT_EQ(*ring.enter(RoundId{5}), 7);
  EXPECT_EQ(ring.find(RoundId{5 + kRoundSlots}), nullptr);
}

TEST(RoundRing, AYoungerRoundTakesTheSlotAndFindsItFresh) {
  RoundRing<int> ring;
  *ring.enter(RoundId{5}) = 7;
  EXPECT_EQ(*ring.enter(RoundId{5 + kRoundSlots}), 0);
  EXPECT_EQ(ring.find(RoundId{5}), nullptr);
}

TEST(RoundRing, AStragglerDoesNotPushOutAYoungerRound) {
  RoundRing<int> ring;
  *ring.enter(RoundId{5 + kRoundSlots}) = 7;
  EXPECT_EQ(ring.enter(RoundId{5}), nullptr);
  EXPECT_EQ(*ring.find(RoundId{5 + kRoundSlots}), 7);
}

TEST(RoundRing, NumbersWrap) {
  RoundRing<int> ring;
  const RoundId last{UINT32_MAX};
  const RoundId next{static_cast<std::uint32_t>(last.value + kRoundSlots)};
  ASSERT_LT(next.value, last.value);
  *ring.enter(last) = 1;
  *ring.enter(next) = 2;
  EXPECT_EQ(ring.find(last), nullptr);
  EXPECT_EQ(ring.enter(last), nullptr);
  EXPECT_EQ(*ring.find(next), 2);
}

TEST(RoundRing, ClearedItHoldsNothing) {
  RoundRing<int> ring;
  *ring.enter(RoundId{70}) = 7;
  ring.clear();
  EXPECT_EQ(ring.find(RoundId{70}), nullptr);
  EXPECT_EQ(*ring.enter(RoundId{6}), 0);
}

// Against a map of everything that ever entered: the youngest round of each slot is held, with what
// was last written, and no other.
RC_GTEST_PROP(RoundRing, HoldsTheYoungestRoundOfEachSlot, ()) {
  constexpr std::uint32_t kSlots = 8;
  const auto rounds =
      *rc::gen::container<std::vector<std::uint32_t>>(rc::gen::inRange<std::uint32_t>(0, 50));
  const auto from = *rc::gen::element<std::uint32_t>(0, 1000, UINT32_MAX - 20);
  RoundRing<std::uint32_t, kSlots> ring;
  std::map<std::uint32_t, std::uint32_t> youngest;  // by slot; as counted from `from`
  std::map<std::uint32_t, std::uint32_t> written;
  for (std::uint32_t i = 0; i < rounds.size(); ++i) {
    const std::uint32_t slot = (from + rounds[i]) % kSlots;
    std::uint32_t* value = ring.enter(RoundId{from + rounds[i]});
    const bool straggler = youngest.contains(slot) && youngest[slot] > rounds[i];
    RC_ASSERT((value == nullptr) == straggler);
    if (straggler) continue;
    const bool known = youngest.contains(slot) && youngest[slot] == rounds[i];
    RC_ASSERT(*value == (known ? written[rounds[i]] : 0));
    *value = written[rounds[i]] = i + 1;
    youngest[slot] = rounds[i];
  }
  std::size_t held = 0;
  ring.for_each([&](RoundId round, std::uint32_t value) {
    ++held;
    RC_ASSERT(youngest[round.value % kSlots] == round.value - from);
    RC_ASSERT(written[round.value - from] == value);
  });
  RC_ASSERT(held == youngest.size());
}

}  // namespace
}  // namespace interneuron::round_ring_test
