#include "lab/sim/agenda.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <map>

namespace interneuron::sim::agenda_test {
namespace {

using std::chrono::milliseconds;

TEST(Agenda, ServesInOrderOfTimeThenOfRank) {
  Agenda agenda;
  const auto late = agenda.add(9);
  const auto early = agenda.add(1);
  const auto other = agenda.add(5);
  EXPECT_EQ(agenda.next(), std::nullopt);
  agenda.set(late, milliseconds(2));
  agenda.set(other, milliseconds(1));
  agenda.set(early, milliseconds(2));
  EXPECT_EQ(agenda.next(), milliseconds(1));
  EXPECT_EQ(agenda.take(), 5U);
  EXPECT_EQ(agenda.take(), 1U);
  EXPECT_EQ(agenda.take(), 9U);
  EXPECT_EQ(agenda.next(), std::nullopt);
}

TEST(Agenda, ASourceMayChangeItsMind) {
  Agenda agenda;
  const auto a = agenda.add(1);
  const auto b = agenda.add(2);
  agenda.set(a, milliseconds(1));
  agenda.set(b, milliseconds(2));
  agenda.set(a, milliseconds(3));
  EXPECT_EQ(agenda.next(), milliseconds(2));
  agenda.set(b, std::nullopt);
  EXPECT_EQ(agenda.next(), milliseconds(3));
}

// What is set for the present instant has its turn in this pass only if its rank is still to come.
TEST(Agenda, RanksThatHaveGoneByWaitForTheNextPass) {
  Agenda agenda;
  const auto first = agenda.add(1);
  const auto second = agenda.add(2);
  const auto third = agenda.add(3);
  agenda.set(second, milliseconds(1));
  EXPECT_EQ(agenda.take(), 2U);
  agenda.set(first, milliseconds(1));
  agenda.set(third, milliseconds(1));
  EXPECT_EQ(agenda.take(), 3U);
  EXPECT_EQ(agenda.take(), 1U);
  agenda.finish();
  agenda.set(third, milliseconds(1));
  agenda.set(first, milliseconds(1));
  EXPECT_EQ(agenda.take(), 1U);
  EXPECT_EQ(agenda.take(), 3U);
}

RC_GTEST_PROP(AgendaProperty, AgreesWithASortedList, ()) {
  Agenda agenda;
  constexpr std::uint64_t kSources = 20;
  for (std::uint64_t rank = 0; rank < kSources; ++rank) agenda.add(rank);
  std::map<std::uint64_t, Duration> wanted;
  for (int i = 0; i < 200; ++i) {
    const auto rank = *rc::gen::inRange<std::uint64_t>(0, kSources);
    const auto source = static_cast<Agenda::Source>(rank);
    if (*rc::gen::inRange(0, 4) == 0) {
      agenda.set(source, std::nullopt);
      wanted.erase(rank);
    } else {
      const Duration at = milliseconds(*rc::gen::inRange(1, 30));
      agenda.set(source, at);
      wanted[rank] = at;
    }
  }
  while (!wanted.empty()) {
    const auto first = std::ranges::min_element(
        wanted, {}, [](const auto& entry) { return std::pair(entry.second, entry.first); });
    RC_ASSERT(agenda.next() == first->second);
    RC_ASSERT(agenda.take() == first->first);
    wanted.erase(first);
  }
  RC_ASSERT(!agenda.next());
}

}  // namespace
}  // namespace interneuron::sim::agenda_test
