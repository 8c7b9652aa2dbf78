// The guard kBudget through whole endpoints: every node follows the origin, previews are carried
// out, levels follow what the rounds took, whatever the clocks' offset.
#include <gtest/gtest.h>

#include "pipe.h"

namespace interneuron::budget_test {
namespace {

std::vector<LevelProfile> ladder() {
  return {{8ms, 10ms, {0.14, 0.13}}, {19ms, 24ms, {0.35, 0.33}}, {44ms, 46ms, {0.40, 0.38}}};
}

// A vehicle (0) and a roadside unit (1) that computes at the level it is told.
class Offloading {
 public:
  explicit Offloading(Duration road_offset) {
    PipelineConfig pipeline = pipeline_of(offload_stages());
    pipeline.guard = GuardKind::kBudget;
    pipeline.levels = ladder();
    pipeline.fallback.local = 0.14;
    pipe.add_host(options_of(1, {pipeline}));
    pipe.add_host(options_of(2), road_offset);
    pipe.connect(0, 1);
    pipe.on_event = [this](std::size_t host, Event& event) { on_event(host, event); };
    pipe.run(1s);
  }
  void round() {
    pipe.round(0, PipelineId{0}, {Bytes(20'000), Bytes(5'000)});
    pipe.run(200ms);
  }

  Pipe pipe;
  Duration slower{};  // every computation takes so much longer
  std::vector<std::size_t> levels;
  std::vector<Plan> plans;
  int done = 0;
  int on_time = 0;

 private:
  void on_event(std::size_t host, Event& event) {
    if (const auto* delivered = std::get_if<Delivered>(&event)) {
      const RoundRef ref = delivered->round;
      levels.push_back(pipe.at(1).begin_computation(pipe.local(1), ref, ladder(), 2));
      pipe.plan(ladder()[levels.back()].median + slower, [this, ref] { pipe.submit(1, ref, 500); });
    } else if (auto* planned = std::get_if<Planned>(&event); planned != nullptr && host == 0) {
      plans.push_back(planned->plan);
    } else if (const auto* end = std::get_if<RoundDone>(&event)) {
      ++done;
      on_time += end->outcome == Outcome::kRemote ? 1 : 0;
    }
  }
};

TEST(Budget, LevelsFollowWhatRoundsTakeWhateverTheOffset) {
  std::vector<std::size_t> first;
  for (const Duration offset : {Duration{0}, Duration{1h}, Duration{-1h}, Duration{24h}}) {
    Offloading o(offset);
    for (int i = 0; i < 60; ++i) o.round();
    EXPECT_EQ(o.levels.back(), 2U);
    o.slower = 90ms;  // the top level would take more than D_N
    for (int i = 0; i < 60; ++i) o.round();
    EXPECT_LT(o.levels.back(), 2U);
    EXPECT_EQ(o.done, 120);
    EXPECT_GE(o.on_time, 110);
    if (first.empty()) first = o.levels;
    EXPECT_EQ(o.levels, first);
  }
}

TEST(Budget, WhatWasPreviewedIsSent) {
  Offloading o({});
  for (int i = 0; i < 10; ++i) o.round();
  Endpoint& vehicle = o.pipe.at(0);
  const TimePoint now = o.pipe.local(0);
  const RoundRef ref = vehicle.begin_round(now, PipelineId{0});
  const std::size_t sizes[] = {20'000, 5'000};
  const Plan plan = vehicle.preview(now, ref, sizes, MessageClass::kData);
  ASSERT_FALSE(plan.sends.empty());
  // Variants that the plan does not hold need not be there.
  Variants variants(2);
  for (const Assignment& a : plan.sends) variants[a.variant].resize(sizes[a.variant]);
  EXPECT_EQ(vehicle.submit(now, ref, variants, MessageClass::kData), SubmitStatus::kAccepted);
  o.pipe.flush(0);
  EXPECT_EQ(o.plans.back().sends, plan.sends);
}

// Sends a message of three variants only where its second one is the best, and any other whole.
class Picky final : public Policy {
 public:
  std::string_view name() const override { return "picky"; }
  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    Plan plan;
    const std::uint8_t variant = guidance.variant.value_or(0);
    EXPECT_LT(variant, offer.variant_bytes.size());
    if (guidance.degraded && guidance.variant) {
      EXPECT_EQ(variant + 1U, offer.variant_bytes.size());
    }
    if (offer.variant_bytes.size() == 3 && variant != 1) return plan;
    for (const LinkState& link : links) plan.sends.push_back({variant, link.id});
    return plan;
  }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

class PickyRounds {
 public:
  PickyRounds() {
    PipelineConfig pipeline = pipeline_of(offload_stages());
    pipeline.guard = GuardKind::kBudget;
    pipeline.policy = "picky";
    EndpointOptions vehicle = options_of(1, {pipeline});
    EndpointOptions road = options_of(2);
    vehicle.policies.push_back(std::make_shared<const Picky>());
    road.policies.push_back(std::make_shared<const Picky>());
    pipe.add_host(vehicle);
    pipe.add_host(road);
    pipe.connect(0, 1);
    pipe.on_event = [this](std::size_t, Event& event) {
      if (const auto* got = std::get_if<Delivered>(&event)) delivered.push_back(*got);
      if (const auto* planned = std::get_if<Planned>(&event)) plans.push_back(planned->plan);
    };
    pipe.run(1s);
    // The links are measured by what they carry.
    for (int i = 0; i < 20; ++i) {
      pipe.round(0, PipelineId{0}, {Bytes(20'000)});
      pipe.run(100ms);
    }
    delivered.clear();
    plans.clear();
  }
  Pipe pipe;
  std::vector<Delivered> delivered;
  std::vector<Plan> plans;
};

TEST(Budget, TheGuardNamesTheVariantAmongMany) {
  PickyRounds o;
  o.pipe.round(0, PipelineId{0}, {Bytes(20'000), Bytes(10'000), Bytes(5'000)});
  o.pipe.run(100ms);
  ASSERT_EQ(o.delivered.size(), 1U);
  EXPECT_EQ(o.delivered[0].variant, 1);
  EXPECT_FALSE(o.delivered[0].degraded);
}

TEST(Budget, WhatWasNamedForAnotherMessageIsNamedAnew) {
  PickyRounds o;
  Endpoint& vehicle = o.pipe.at(0);
  const TimePoint now = o.pipe.local(0);
  const RoundRef ref = vehicle.begin_round(now, PipelineId{0});
  const std::size_t three[] = {20'000, 10'000, 5'000};
  EXPECT_EQ(vehicle.preview(now, ref, three, MessageClass::kData).sends.front().variant, 1);
  EXPECT_EQ(vehicle.submit(now, ref, {Bytes(20'000)}, MessageClass::kData),
            SubmitStatus::kAccepted);
  o.pipe.flush(0);
  o.pipe.run(100ms);
  ASSERT_EQ(o.delivered.size(), 1U);
  EXPECT_EQ(o.delivered[0].variant, 0);
}

TEST(Budget, NothingIsPreviewedForARoundThatIsNotKnown) {
  Offloading o({});
  const std::size_t sizes[] = {1000};
  const RoundRef unknown{SessionId{1}, PipelineId{0}, RoundId{99}};
  EXPECT_TRUE(
      o.pipe.at(0).preview(o.pipe.local(0), unknown, sizes, MessageClass::kData).sends.empty());
  EXPECT_EQ(o.pipe.at(1).begin_computation(o.pipe.local(1), unknown, ladder(), 1), 1U);
}

}  // namespace
}  // namespace interneuron::budget_test
