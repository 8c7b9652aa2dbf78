// Times what the guard kBudget and the policies decide per stage, with full books and a peer that
// is sometimes late. The aim is 10 µs per stage for guard and policy together, a ten-thousandth of
// a camera's period; a benchmark that allocates fails.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <new>
#include <span>
#include <string>

#include "core/guard/observers.h"
#include "core/guard/origins.h"
#include "core/link/nature.h"
#include "core/plan/budget.h"
#include "core/plan/plan_message.h"
#include "interneuron/policy.h"

namespace {
std::uint64_t allocations = 0;
}  // namespace

[[gnu::noinline]] void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size == 0 ? 1 : size)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }

namespace interneuron::bench {
namespace {

using namespace guard;
using namespace std::chrono_literals;

constexpr Duration kDeadline = 130ms;
// Rounds before the clock runs: more than any of the guard's histories holds, so that all are full.
constexpr int kFilled = 600;

std::vector<LevelProfile> ladder(std::size_t levels) {
  std::vector<LevelProfile> out;
  for (std::size_t i = 1; i <= levels; ++i) {
    const Duration median = 44ms * i / levels;
    out.push_back({median, median * 11 / 10, {0.4 * static_cast<double>(i), 0.35}});
  }
  return out;
}

// The delay that a round suffers: 0 to 39 ms, another one in each round.
Duration lost(std::uint32_t round, std::uint32_t salt) {
  return std::chrono::milliseconds((round * 2654435761U + salt * 40503U) % 40U);
}

// Times `decide` and fails the benchmark if it allocates.
template <class Decision>
void count_allocations(benchmark::State& bench, const Decision& decide) {
  const std::uint64_t before = allocations;
  for (auto _ : bench) decide();
  const std::uint64_t more = allocations - before;
  bench.counters["allocations"] = static_cast<double>(more);
  if (more > 0) bench.SkipWithError("it allocates");
}

// A BudgetObserver in the middle of its work: a round every 100 ms, each tenth of which is never
// answered. Every benchmark calls one of its steps again and again.
class Road {
 public:
  explicit Road(std::size_t levels) : levels_(ladder(levels)) {
    for (int i = 0; i < kFilled; ++i) round();
  }
  StageEnd end(std::size_t stage) const {
    return StageEnd{.round = RoundId{round_},
                    .stage = stage,
                    .t0 = PeerTime{round_ * 100ms},
                    .deadline = kDeadline,
                    .variant = 1,
                    .terms = {GuardKind::kBudget, 1.0, 0.14}};
  }
  TimePoint start() const { return TimePoint{round_ * 100ms + 40ms + lost(round_, 1)}; }
  void round() {
    hold();
    StageEnd up = end(1);
    up.variant = 0;
    budget.note_arrival(start() + 3ms, up);
    begin();
    settle();
  }
  std::size_t begin() {
    return budget.begin_computation(start(), end(1), {}, levels_, 0, {}).level;
  }
  TimePoint hold() {
    budget.note_arrival(start() - 5ms, end(1));
    return budget.hold(start() - 5ms, end(1), std::nullopt, false).until;
  }
  void settle() {
    StageEnd done = end(2);
    done.is_computation = true;
    const Duration after = lost(round_, 2);
    budget.end_stage(start() + 45ms + after, done, std::nullopt);
    const bool never = round_ % 10 == 0;
    budget.settle(start() + 60ms, RoundId{round_},
                  never ? RoundState::kMissed : RoundState::kOnTime,
                  never ? kNever : 97ms + lost(round_, 1) + after);
    ++round_;
  }
  BudgetObserver budget;

 private:
  std::vector<LevelProfile> levels_;
  std::uint32_t round_ = 0;
};

// Choosing a level at the start of a computation. The argument is the number of levels.
void begin_computation(benchmark::State& bench) {
  Road road(static_cast<std::size_t>(bench.range(0)));
  count_allocations(bench, [&] { benchmark::DoNotOptimize(road.begin()); });
}
BENCHMARK(begin_computation)->Arg(3)->Arg(6)->Arg(16);

// Deciding how long to wait for the larger variant. The argument is the number of levels.
void hold(benchmark::State& bench) {
  Road road(static_cast<std::size_t>(bench.range(0)));
  count_allocations(bench, [&] { benchmark::DoNotOptimize(road.hold()); });
}
BENCHMARK(hold)->Arg(3)->Arg(6);

// A whole round at the node that observes: arrivals, hold, level, end of the computation, outcome.
void whole_round(benchmark::State& bench) {
  Road road(3);
  count_allocations(bench, [&] { road.round(); });
}
BENCHMARK(whole_round);

// Two idle links with measured round trips and rates, both trusted.
std::vector<LinkState> two_links() {
  LinkState link{.up = true, .path = PathState::kOk};
  link.rtt_p50 = link.rtt_p95 = 22ms;
  link.rate = DataRate::mbit(100);
  link.traits.trusted = true;
  link.confidence = 1;
  LinkState other = link;
  other.id = LinkId{1};
  other.rtt_p50 = other.rtt_p95 = 45ms;
  other.rate = DataRate::mbit(30);
  std::vector<LinkState> links{link, other};
  link::score(links);
  return links;
}

// A policy's plan for one message, with the checks of plan_message().
void plan_of(benchmark::State& bench, const Policy& policy) {
  const std::vector<LinkState> links = two_links();
  const std::vector<LevelProfile> levels = ladder(3);
  const std::size_t sizes[] = {524'288, 131'072};
  const Offer offer{{kDeadline, 100ms, MessageClass::kData, {}}, sizes};
  const Guidance guidance{.time_left = kDeadline, .levels = levels, .local_quality = 0.14};
  count_allocations(
      bench, [&] { benchmark::DoNotOptimize(plan::plan_message(policy, offer, links, guidance)); });
}

// The decision which variant is the best one sent: the policy's plans for each, the forecasts of
// their answers, and the guard's choice.
void first_transmission(benchmark::State& bench, const Policy& policy, std::size_t variants) {
  PipelineConfig config{.guard = GuardKind::kBudget, .levels = ladder(3)};
  BudgetOrigin origin(config);
  const std::vector<LinkState> links = two_links();
  // The ladder of JPEGs has four.
  const std::size_t sizes[] = {524'288, 131'072, 70'000, 25'000};
  const Offer offer{{kDeadline, 100ms, MessageClass::kData, {}}, std::span(sizes).first(variants)};
  std::uint32_t round = 0;
  const auto choose = [&] {
    std::array<guard::Forecast, kMaxVariants> modes;
    for (std::size_t mode = 0; mode < variants; ++mode) {
      const Guidance guidance{.degraded = mode + 1 == variants,
                              .variant = static_cast<std::uint8_t>(mode),
                              .time_left = kDeadline,
                              .levels = config.levels};
      modes[mode] =
          plan::forecast_answers(plan::plan_message(policy, offer, links, guidance), offer, links);
    }
    return origin.choose_mode(TimePoint{round * 100ms}, RoundId{round}, 1ms,
                              std::span(modes).first(variants));
  };
  for (; round < kFilled; ++round) {
    Spent spent{.level = 2,
                .variant = static_cast<std::uint8_t>(choose()),
                .excess = lost(round, 1),
                .computed = 44ms};
    origin.result(TimePoint{round * 100ms + 120ms}, RoundId{round}, 90ms + lost(round, 2), spent);
  }
  count_allocations(bench, [&] { benchmark::DoNotOptimize(choose()); });
}

void register_policies() {
  static const PolicySet policies = builtin_policies();
  for (const auto& policy : policies) {
    const std::string name(policy->name());
    benchmark::RegisterBenchmark(("plan/" + name).c_str(), plan_of, std::cref(*policy));
    for (const std::size_t variants : {2, 4}) {
      const std::string of = "first_transmission/" + name + "/" + std::to_string(variants);
      benchmark::RegisterBenchmark(of.c_str(), first_transmission, std::cref(*policy), variants);
    }
  }
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  interneuron::bench::register_policies();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
