// Random loss, reordering, duplication and outages: every round has exactly one outcome, never
// after the deadline plus one tick of the loop, in bounded memory.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "support.h"

namespace interneuron::sim::property_test {
namespace {

struct Outage {
  LinkId link{};
  Duration from{};
  Duration length{};
};

Faults any_faults() {
  Faults f;
  f.loss = *rc::gen::inRange(0, 60) / 100.0;
  f.duplicate = *rc::gen::inRange(0, 30) / 100.0;
  f.reorder = *rc::gen::inRange(0, 30) / 100.0;
  f.reorder_by = Duration{*rc::gen::inRange(1'000, 80'000'000)};
  return f;
}

RC_GTEST_PROP(Rounds, HaveExactlyOneOutcomeByTheDeadlineWhateverTheLinksDo, ()) {
  OffloadOptions o;
  o.seed = *rc::gen::inRange<std::uint64_t>(1, 1'000'000);
  o.rounds = 30;
  o.profiles = {profile("5g"), profile("4g")};
  o.policy = *rc::gen::element<std::string>("best_link", "duplicate", "down_sampling");
  o.ablation.repair = *rc::gen::arbitrary<bool>();
  o.local_backup = *rc::gen::arbitrary<bool>();
  const auto raw = *rc::gen::inRange<std::size_t>(1, 300'000);
  o.variant_bytes = {raw, raw / 4 + 1};
  o.vehicle_clock.offset =
      Duration{*rc::gen::inRange<std::int64_t>(-86'400'000'000'000, 86'400'000'000'000)};
  o.road_clock.drift_ppm = *rc::gen::inRange(-200, 200);
  const Faults faults[2] = {any_faults(), any_faults()};
  const auto outages = *rc::gen::container<std::vector<Outage>>(
      rc::gen::map(rc::gen::tuple(rc::gen::inRange<int>(0, 2), rc::gen::inRange(0, 3000),
                                  rc::gen::inRange(1, 1500)),
                   [](const std::tuple<int, int, int>& t) {
                     return Outage{LinkId{static_cast<std::uint8_t>(std::get<0>(t))},
                                   std::get<1>(t) * 1ms, std::get<2>(t) * 1ms};
                   }));
  const OffloadResult result = run_offload(o, [&](World& world) {
    for (std::uint8_t i = 0; i < 2; ++i) world.faults(LinkId{i}) = faults[i];
    for (const Outage& outage : outages) {
      world.at(outage.from, [&world, outage] { world.faults(outage.link).cut = true; });
      world.at(outage.from + outage.length,
               [&world, outage] { world.faults(outage.link).cut = false; });
    }
  });
  for (const OffloadRound& r : result.rounds) {
    RC_ASSERT(r.answers == 1U);
    RC_ASSERT(r.done.e2e <= o.deadline + 1us);  // virtual loops tick exactly
    if (r.done.outcome == Outcome::kRemote) RC_ASSERT(r.done.e2e <= o.deadline);
  }
  RC_ASSERT(result.max_reassembly_bytes <= 16U * 1024 * 1024);
}

}  // namespace
}  // namespace interneuron::sim::property_test
