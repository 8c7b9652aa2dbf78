#include "lab/emu/cell.h"

#include <algorithm>

#include "support.h"

namespace interneuron::emu::cell_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

// 8 Mbit/s: 1000 bytes a millisecond.
CellParams cell_of(std::size_t queue_bytes = kMegabyte) {
  return CellParams{.rate = DataRate::mbit(8), .queue_bytes = queue_bytes};
}

std::vector<Cell::Departed> drain_cell(Cell& cell, Duration until = kEver) {
  std::vector<Cell::Departed> out;
  while (const auto departed = cell.dequeue(until)) out.push_back(*departed);
  return out;
}

// Offers a packet of 1000 bytes every `gap` from `from` to `to`, and takes out what leaves.
std::vector<Cell::Departed> offer(Cell& cell, Duration from, Duration to, Duration gap, Ecn ecn) {
  std::vector<Cell::Departed> out;
  for (Duration t = from; t < to; t += gap) {
    cell.enqueue(t, {0, 0, 1000, ecn});
    while (const auto departed = cell.dequeue(t)) out.push_back(*departed);
  }
  return out;
}

TEST(Cell, FlowsShareOneQueueInOrder) {
  Cell cell(cell_of());
  EXPECT_EQ(cell.next_departure(), std::nullopt);
  EXPECT_TRUE(cell.enqueue({}, {10, 0, 1000}));
  EXPECT_TRUE(cell.enqueue({}, {11, 3, 500}));
  EXPECT_EQ(cell.next_departure(), milliseconds(1));
  EXPECT_EQ(cell.dequeue(milliseconds(1) - Duration{1}), std::nullopt);
  const auto out = drain_cell(cell);
  ASSERT_EQ(out.size(), 2U);
  EXPECT_EQ(out[0].packet.tag, 10U);
  EXPECT_EQ(out[1].packet.tag, 11U);
  EXPECT_EQ(out[1].at, std::chrono::microseconds(1500));
  EXPECT_EQ(cell.stats(0).bytes_delivered, 1000U);
  EXPECT_EQ(cell.stats(3).bytes_delivered, 500U);
  EXPECT_EQ(cell.stats(2).packets_in, 0U);
  EXPECT_EQ(cell.stats(99).packets_in, 0U);
  EXPECT_EQ(cell.stats().bytes_delivered, 1500U);
}

TEST(Cell, AFullQueueDropsAtItsTail) {
  Cell cell(cell_of(queue_bytes_of(DataRate::mbit(8), milliseconds(3))));
  int taken = 0;
  for (int i = 0; i < 5; ++i) taken += cell.enqueue({}, {0, 0, 1000, Ecn::kEct0}) ? 1 : 0;
  EXPECT_EQ(taken, 3);
  EXPECT_EQ(cell.waiting_bytes(), 3000U);
  EXPECT_EQ(cell.stats().queue_drops, 2U);
  // The packet that leaves at this very instant makes room.
  EXPECT_TRUE(cell.enqueue(milliseconds(1), {0, 0, 1000}));
}

TEST(Cell, AnIdleBottleneckTakesAnyPacketOfItsMtu) {
  CellParams params = cell_of(0);
  params.mtu = 1380;
  Cell cell(params);
  EXPECT_FALSE(cell.enqueue({}, {0, 0, 1381}));
  EXPECT_TRUE(cell.enqueue({}, {0, 0, 1380}));
  EXPECT_EQ(cell.stats().too_big, 1U);
}

TEST(Cell, ARateThatStaysZeroLetsNothingPass) {
  CellParams params = cell_of();
  params.rate = {};
  Cell cell(params);
  EXPECT_TRUE(cell.enqueue({}, {0, 0, 1000}));
  EXPECT_EQ(cell.next_departure(), std::nullopt);
  EXPECT_TRUE(drain_cell(cell).empty());
  EXPECT_EQ(cell.utilisation(seconds(1)), 0);
}

TEST(Cell, KnowsHowLongItsQueueIsOverTime) {
  Cell cell(cell_of());
  // A burst of 100 ms each second.
  for (int i = 0; i < 1000; ++i) {
    cell.enqueue(seconds(i / 100), {0, 0, 1000});
    drain_cell(cell, seconds(i / 100));
  }
  drain_cell(cell);
  cell.enqueue(seconds(10), {0, 0, 1000});
  EXPECT_EQ(cell.queue_time().counted(), seconds(10));
  EXPECT_EQ(cell.queue_time().quantile(0.9), Duration{});
  EXPECT_NEAR(to_ms(cell.queue_time().quantile(0.99)), 90, 0.2);
  EXPECT_NEAR(to_ms(cell.queue_time().mean()), 5, 0.01);
  EXPECT_NEAR(cell.utilisation(seconds(10)), 0.1, 0.0001);
  cell.measure_from(seconds(10));
  EXPECT_EQ(cell.queue_time().counted(), Duration{});
  EXPECT_EQ(cell.utilisation(seconds(11)), 0);
}

TEST(Cell, AnOverloadedQueueStandsAtItsLimit) {
  Cell cell(cell_of(queue_bytes_of(DataRate::mbit(8), milliseconds(300))));
  offer(cell, {}, seconds(30), std::chrono::microseconds(800), Ecn::kNotEct);
  EXPECT_NEAR(to_ms(cell.queue_time().quantile(0.99)), 300, 1.5);
  EXPECT_NEAR(cell.utilisation(seconds(30)), 1, 0.001);
}

TEST(Cell, CoDelDropsWhatDoesNotUnderstandMarks) {
  CellParams params = cell_of();
  params.codel = CoDelParams{};
  Cell cell(params);
  // 125 % of the rate: after 120 ms a packet has waited for 24 ms, and after 25 ms for 5.
  const auto out = offer(cell, {}, milliseconds(150), std::chrono::microseconds(800), Ecn::kNotEct);
  const auto dropped = std::ranges::count(out, true, &Cell::Departed::dropped);
  EXPECT_EQ(dropped, 1);
  EXPECT_EQ(cell.stats().codel_drops, 1U);
  EXPECT_EQ(cell.stats().marked, 0U);
  const auto first = std::ranges::find(out, true, &Cell::Departed::dropped);
  EXPECT_NEAR(to_ms(first->at), 125, 1.5);
}

TEST(Cell, CoDelMarksWhatUnderstandsMarks) {
  CellParams params = cell_of();
  params.codel = CoDelParams{};
  Cell cell(params);
  const auto out = offer(cell, {}, seconds(1), std::chrono::microseconds(800), Ecn::kEct0);
  EXPECT_EQ(cell.stats().codel_drops, 0U);
  EXPECT_GT(cell.stats().marked, 10U);
  EXPECT_EQ(
      std::ranges::count_if(out, [](const Cell::Departed& d) { return d.packet.ecn == Ecn::kCe; }),
      static_cast<std::ptrdiff_t>(cell.stats().marked));
}

TEST(Cell, CoDelLeavesABurstAlone) {
  CellParams params = cell_of();
  params.codel = CoDelParams{};
  Cell cell(params);
  for (int i = 0; i < 90; ++i) cell.enqueue({}, {0, 0, 1000});
  EXPECT_EQ(drain_cell(cell).size(), 90U);
  EXPECT_EQ(cell.stats().codel_drops, 0U);
}

TEST(Cell, TheStepMarksOnlyL4s) {
  CellParams params = cell_of();
  params.mark_above = milliseconds(1);
  Cell cell(params);
  for (const Ecn ecn : {Ecn::kEct1, Ecn::kEct1, Ecn::kEct1, Ecn::kEct0, Ecn::kNotEct}) {
    cell.enqueue({}, {0, 0, 1000, ecn});
  }
  std::vector<Ecn> out;
  for (const auto& departed : drain_cell(cell)) out.push_back(departed.packet.ecn);
  // The second has waited for 1 ms exactly, the third for 2.
  EXPECT_EQ(out, (std::vector<Ecn>{Ecn::kEct1, Ecn::kEct1, Ecn::kCe, Ecn::kEct0, Ecn::kNotEct}));
}

// The wait for an opportunity counts for CoDel, and a packet that it drops leaves its opportunity
// to the next.
TEST(Cell, CoDelJudgesAtOpportunities) {
  CellParams params = cell_of();
  params.trace = std::make_shared<const Opportunities>(Opportunities{{200}});
  params.codel = CoDelParams{};
  Cell cell(params);
  for (std::uint64_t i = 0; i < 6; ++i) cell.enqueue({}, {i, 0, 1500});
  const auto out = drain_cell(cell, milliseconds(450));
  ASSERT_EQ(out.size(), 3U);
  EXPECT_FALSE(out[0].dropped);
  // The interval of 100 ms has passed at the second opportunity.
  EXPECT_TRUE(out[1].dropped);
  EXPECT_EQ(out[1].at, milliseconds(400));
  EXPECT_FALSE(out[2].dropped);
  EXPECT_EQ(out[2].at, milliseconds(400));
}

}  // namespace
}  // namespace interneuron::emu::cell_test
