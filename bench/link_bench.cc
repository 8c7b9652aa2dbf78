// Times what runs per feedback and per message: an estimator's update, the state of a link, scoring
// and matching for 2, 8 and 64 NICs. The aims are 100 ns per update and 1 µs for scoring 8 NICs
// (docs/constants.md, "Aims of the benchmarks").
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <vector>

#include "core/link/link_estimator.h"
#include "core/link/nature.h"
#include "interneuron/requirement.h"

namespace interneuron::bench {
namespace {

using namespace link;
using namespace std::chrono_literals;

// Random round trips between 20 and 60 ms, drawn before the clock runs.
class Rtts {
 public:
  Rtts() {
    std::uint64_t random = 88172645463325252U;
    for (Duration& rtt : values_) {
      random ^= random << 13;
      random ^= random >> 7;
      random ^= random << 17;
      rtt = 20ms + Duration{static_cast<std::int64_t>(random % 40'000'000)};
    }
  }
  Duration operator()() { return values_[next_++ % values_.size()]; }

 private:
  std::array<Duration, 4096> values_{};
  std::size_t next_ = 0;
};

// The argument is the number of samples per second, which decides how many are in the window.
void rtt_update(benchmark::State& bench) {
  RttEstimator e;
  TimePoint now{};
  Rtts some_rtt;
  const Duration step = Duration{1s} / bench.range(0);
  for (auto _ : bench) {
    now += step;
    e.add(now, some_rtt());
  }
  benchmark::DoNotOptimize(e.quantile(now, 0.95));
}
BENCHMARK(rtt_update)->Arg(20)->Arg(60)->Arg(200)->Arg(1000);

void rtt_quantile(benchmark::State& bench) {
  RttEstimator e;
  TimePoint now{};
  Rtts some_rtt;
  for (int i = 0; i < 1000; ++i) e.add(now += 5ms, some_rtt());
  for (auto _ : bench) benchmark::DoNotOptimize(e.quantile(now, 0.95));
}
BENCHMARK(rtt_quantile);

void loss_update(benchmark::State& bench) {
  LossEstimator e;
  TimePoint now{};
  std::uint64_t i = 0;
  for (auto _ : bench) {
    now += 1ms;
    if (++i % 50 == 0) {
      e.lost(now, 1);
    } else {
      e.arrived(now, 1);
    }
  }
  benchmark::DoNotOptimize(e.loss());
}
BENCHMARK(loss_update);

void queue_update(benchmark::State& bench) {
  QueueSignal q;
  TimePoint now{};
  Rtts some_rtt;
  for (auto _ : bench) q.add(now += 5ms, some_rtt());
  benchmark::DoNotOptimize(q.queue(now));
}
BENCHMARK(queue_update);

// The i-th report of trains that are told six times as they grow.
Train growing_train(std::uint64_t i) {
  const auto packets = static_cast<std::uint32_t>(16 + i % 6 * 16);
  return {i / 6 * 100 + 1,    packets, packets, (packets - 1) * 1428, DataRate::mbit(20),
          DataRate::mbit(25), {}};
}

void rate_update(benchmark::State& bench) {
  RateEstimator e;
  TimePoint now{};
  std::uint64_t i = 0;
  for (auto _ : bench) {
    ++i;
    e.train(now += 5ms, growing_train(i));
  }
  benchmark::DoNotOptimize(e.rate());
}
BENCHMARK(rate_update);

void path_update(benchmark::State& bench) {
  PathMachine m;
  TimePoint now{};
  m.set_pace(now, {40ms, 2ms, {}, 50ms});
  for (auto _ : bench) {
    now += 5ms;
    m.sent(now, true);
    m.heard(now);
    m.delivered(now, now - 1ms, true);
  }
  benchmark::DoNotOptimize(m.next_timeout());
}
BENCHMARK(path_update);

// Everything that one feedback on one path updates.
void feedback_update(benchmark::State& bench) {
  LinkEstimator e;
  TimePoint now{};
  Rtts some_rtt;
  std::uint64_t i = 0;
  for (auto _ : bench) {
    ++i;
    now += 16ms;
    e.heard(now);
    e.round_trip(now, some_rtt());
    e.one_way_delays(now, 10ms, 10ms);
    e.arrived(now, 16);
    e.delivered(now, now - 20ms, true);
    e.train(now, growing_train(i));
  }
  benchmark::DoNotOptimize(e.state(now));
}
BENCHMARK(feedback_update);

void link_state(benchmark::State& bench) {
  LinkEstimator e;
  TimePoint now{};
  Rtts some_rtt;
  e.heard(now);
  for (int i = 0; i < 200; ++i) e.round_trip(now += 16ms, some_rtt());
  for (auto _ : bench) benchmark::DoNotOptimize(e.state(now));
}
BENCHMARK(link_state);

std::vector<LinkState> some_links(std::size_t n) {
  Rtts some_rtt;
  std::vector<LinkState> links(n);
  for (std::size_t i = 0; i < n; ++i) {
    links[i].id = LinkId{static_cast<std::uint8_t>(i)};
    links[i].up = true;
    links[i].rtt_p95 = some_rtt();
    links[i].rate = DataRate::mbit(to_ms(some_rtt()));
    links[i].loss = to_ms(some_rtt()) / 1e4;
    links[i].age = 100ms;
  }
  return links;
}

void scoring(benchmark::State& bench) {
  std::vector<LinkState> links = some_links(static_cast<std::size_t>(bench.range(0)));
  for (auto _ : bench) {
    score(links);
    benchmark::DoNotOptimize(links.data());
    benchmark::ClobberMemory();
  }
}
BENCHMARK(scoring)->Arg(2)->Arg(8)->Arg(64);

void matching(benchmark::State& bench) {
  std::vector<LinkState> links = some_links(static_cast<std::size_t>(bench.range(0)));
  score(links);
  const Requirement requirement{
      .min_rate = DataRate::mbit(30), .weights = {.delay = 1, .bandwidth = 0.5}, .links = 2};
  for (auto _ : bench) benchmark::DoNotOptimize(match(requirement, links));
}
BENCHMARK(matching)->Arg(2)->Arg(8)->Arg(64);

}  // namespace
}  // namespace interneuron::bench

BENCHMARK_MAIN();
