// Queues that mark packets instead of dropping them, and ways that lose or invent marks.
#include <gtest/gtest.h>

#include "interneuron/sizes.h"
#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::ecn_test {
namespace {

constexpr LinkId kLink{0};
constexpr std::size_t kBytes = 48 * 1024;
// With the headers of its 36 pieces.
constexpr std::size_t kIpBytes = kBytes + 36 * (kPieceOverheadBytes + kIpUdpBytes);
constexpr DataRate kRate = DataRate::mbit(20);
constexpr std::size_t kMessages = 600;

// Between two messages that offer this load.
Duration period_of(double load) {
  return Duration{
      static_cast<std::int64_t>(static_cast<double>(kRate.transmit_time(kIpBytes).count()) / load)};
}

// A vehicle that sends messages of 48 KiB through a cell of 20 Mbit/s for 10 s and more.
struct Cell {
  Duo stream;
  CellId cell;
  Duration period;

  explicit Cell(double load, const emu::CellParams& params, std::uint64_t seed = 1)
      : stream({constant_link("modem", 40, 1000, 1000)},
               {.variants = {kBytes}, .deadline = 150ms, .period = period_of(load), .seed = seed}),
        cell(stream.world.add_cell(params)),
        period(period_of(load)) {
    stream.world.pass_through(stream.world.wire_of(kLink), true, cell);
  }
  Faults& faults() { return stream.world.faults(kLink); }
  const emu::CellStats& stats() { return stream.world.cell(cell).stats(); }
  LinkState link() {
    World& world = stream.world;
    return world.endpoint(stream.vehicle).links(world.local_time(stream.vehicle), stream.peer)[0];
  }
  void run(Duration begin = 1s) {
    stream.world.run_until(begin);
    stream.world.measure_cells();
    stream.send(begin, kMessages);
    stream.run();
  }
  // What is on time, as a share of what the cell could carry in that time.
  double goodput() const {
    const auto on_time = static_cast<double>(kMessages - stream.missed());
    return on_time * to_seconds(kRate.transmit_time(kIpBytes)) / (kMessages * to_seconds(period));
  }
  double queue_p99_ms() { return to_ms(stream.world.cell(cell).queue_time().quantile(0.99)); }
};

emu::CellParams codel() {
  emu::CellParams params{.rate = kRate, .queue_bytes = emu::queue_bytes_of(kRate, 300ms)};
  params.codel.emplace();
  return params;
}

// As a queue for L4S does: all that waits for more than a millisecond.
emu::CellParams step() {
  emu::CellParams params = codel();
  params.codel.reset();
  params.mark_above = 1ms;
  return params;
}

// When the first message is sent decides which packet CoDel takes, so several beginnings are tried.
// What it may drop is what leaves without ECT: a feedback or a heartbeat where it would have
// marked.
TEST(Ecn, CoDelMarksInsteadOfDropping) {
  for (int i = 0; i < 10; ++i) {
    Cell marked(1.5, codel());
    marked.run(1s + i * 7ms);
    EXPECT_EQ(marked.link().ecn, EcnState::kWorks);
    EXPECT_LE(5 * marked.stats().codel_drops, marked.stats().marked) << "beginning " << i;
    EXPECT_GT(marked.stats().marked, 0U);
    EXPECT_GE(marked.goodput(), 0.85);
    EXPECT_LE(marked.queue_p99_ms(), 60);
  }
}

TEST(Ecn, AQueueForL4sStaysShort) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    Cell marked(1.5, step(), seed);
    marked.run();
    Cell bleached(1.5, step(), seed);
    bleached.faults().ecn = Ecn::kNotEct;
    bleached.run();
    std::printf("seed %d: queue p99 %.1f ms, %.1f %% on time; without ECN %.1f ms, %.1f %%\n",
                static_cast<int>(seed), marked.queue_p99_ms(), 100 * marked.goodput(),
                bleached.queue_p99_ms(), 100 * bleached.goodput());
    EXPECT_LT(marked.queue_p99_ms(), bleached.queue_p99_ms());
    EXPECT_GE(marked.goodput(), 0.85);
  }
}

TEST(Ecn, BelowCapacityMarksCostNoMessage) {
  for (const emu::CellParams& params : {codel(), step()}) {
    Cell cell(0.5, params);
    cell.run();
    EXPECT_EQ(cell.stream.missed(), 0U);
    EXPECT_EQ(cell.link().ecn, EcnState::kWorks);
  }
}

TEST(Ecn, BleachedBitsAreNoticedAndCostNothing) {
  Cell cell(1.5, codel());
  cell.faults().ecn = Ecn::kNotEct;
  cell.run();
  EXPECT_EQ(cell.link().ecn, EcnState::kBleached);
  EXPECT_GE(cell.goodput(), 0.85);
}

TEST(Ecn, ANetworkThatMakesTheOtherBitOfItIsNoticed) {
  Cell cell(0.5, codel());
  cell.faults().ecn = Ecn::kEct0;
  cell.run();
  EXPECT_EQ(cell.link().ecn, EcnState::kRewritten);
  EXPECT_EQ(cell.stream.missed(), 0U);
}

TEST(Ecn, MarksOnEveryPacketAreNoticedAndTheRateComesBack) {
  for (const double load : {0.5, 1.5}) {
    emu::CellParams params = codel();
    params.codel.reset();
    Cell cell(load, params);
    cell.faults().ecn = Ecn::kCe;
    cell.stream.send(1s, kMessages);
    cell.stream.run();
    EXPECT_EQ(cell.link().ecn, EcnState::kMangled);
    const std::size_t settled = static_cast<std::size_t>(5s / cell.period);
    const std::size_t missed = cell.stream.missed(settled);
    std::printf("load %.1f: %zu of %zu missed, %zu of them after 5 s\n", load, cell.stream.missed(),
                kMessages, missed);
    const double on_time =
        1 - static_cast<double>(missed) / static_cast<double>(kMessages - settled);
    EXPECT_GE(on_time * load, 0.85 * std::min(load, 1.0));
  }
}

TEST(Ecn, APathThatDropsWhatMayBeMarkedIsUsedWithout) {
  Cell cell(0.5, codel());
  cell.faults().drops_ect = true;
  cell.stream.send(1s, kMessages);
  cell.stream.run();
  EXPECT_EQ(cell.link().ecn, EcnState::kDropped);
  const std::size_t settled = static_cast<std::size_t>(10s / cell.period);
  std::printf("%zu of %zu missed\n", cell.stream.missed(), kMessages);
  EXPECT_EQ(cell.stream.missed(settled), 0U);
}

}  // namespace
}  // namespace interneuron::sim::ecn_test
