// What runs per packet or per scoring allocates nothing.
#include <gtest/gtest.h>

#include <vector>

#include "core/link/link_estimator.h"
#include "core/link/nature.h"
#include "core/link/probe_schedule.h"
#include "tests/counted_heap.h"

namespace interneuron::link::allocation_test {
namespace {

using namespace std::chrono_literals;

TEST(Allocation, IsSeenByThisTest) {
  const std::uint64_t before = allocations;
  std::vector<int> v(100);
  EXPECT_GT(allocations, before) << v.size();
}

TEST(Allocation, NoneWhileAPathWorks) {
  LinkEstimator e;
  DeliveryRate delivery;
  ProbeSchedule prober;
  prober.set_ready(true);
  TimePoint now{};
  e.heard(now);
  while (e.poll_change()) {
  }
  std::uint64_t before = 0;
  for (int i = 0; i < 20'000; ++i) {
    // The window of round trips is full by then.
    if (i == 500) before = allocations;
    now += 5ms;
    e.sent(now, true);
    prober.data_sent(now);
    const DeliveryStamp stamp = delivery.sent(now, 1400, i % 16 == 0, true);
    e.heard(now);
    e.round_trip(now, 20ms + (i * 7919 % 5000) * 1us);
    e.one_way_delays(now, 10ms + (i % 97) * 1us, 10ms);
    e.arrived(now, 15);
    if (i % 9 == 0) e.lost(now, 1);
    e.delivered(now, now - 1ms, true);
    const auto packets = static_cast<std::uint32_t>(16 + i % 8 * 16);
    e.train(now, {static_cast<std::uint64_t>(i / 8) + 1,
                  packets,
                  packets,
                  (packets - 1) * 1428,
                  DataRate::mbit(20),
                  DataRate::mbit(25),
                  {}});
    delivery.acknowledged(now, stamp);
    if (const auto sample = delivery.sample(1ms)) e.delivery_sample(now, *sample);
    prober.set_rate(e.rate_evidence());
    static_cast<void>(prober.train_due(now));
    static_cast<void>(prober.next_timeout(now));
    static_cast<void>(e.next_timeout());
    e.handle_timeout(now);
    static_cast<void>(e.state(now));
    static_cast<void>(e.probe_timeout(now));
  }
  EXPECT_EQ(allocations, before);
}

TEST(Allocation, NoneWhileScoring) {
  std::vector<LinkState> links(8);
  for (std::size_t i = 0; i < links.size(); ++i) {
    links[i].up = true;
    links[i].rtt_p95 = 10ms * static_cast<int>(i + 1);
    links[i].rate = DataRate::mbit(static_cast<double>(10 * i));
  }
  const std::uint64_t before = allocations;
  score(links);
  static_cast<void>(explain(links[3], links));
  EXPECT_EQ(allocations, before);
}

}  // namespace
}  // namespace interneuron::link::allocation_test
