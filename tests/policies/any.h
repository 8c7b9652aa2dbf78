// Any links, message and guidance, for property tests of policies.
#pragma once

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <functional>
#include <set>
#include <vector>

#include "core/link/nature.h"
#include "interneuron/policy.h"

namespace interneuron::policy_test {

inline std::vector<LinkState> any_links() {
  const auto count = *rc::gen::inRange<std::uint8_t>(0, 6);
  std::vector<LinkState> links;
  for (std::uint8_t i = 0; i < count; ++i) {
    LinkState link;
    link.id = LinkId{static_cast<std::uint8_t>(200 - 7 * i)};
    link.up = *rc::gen::inRange(0, 4) > 0;
    link.rtt_p95 = Duration{*rc::gen::oneOf(rc::gen::just<std::int64_t>(0),
                                            rc::gen::inRange<std::int64_t>(1, 1'000'000'000),
                                            rc::gen::inRange<std::int64_t>(1, 60'000'000))};
    link.rate = DataRate{*rc::gen::oneOf(rc::gen::just<std::int64_t>(0),
                                         rc::gen::inRange<std::int64_t>(1, 200'000'000))};
    link.loss = 1e-5 * *rc::gen::inRange(0, 100'000);
    link.rate_age = std::chrono::milliseconds(*rc::gen::inRange(0, 60'000));
    link.confidence = 0.01 * *rc::gen::inRange(0, 101);
    link.traits.metered = *rc::gen::arbitrary<bool>();
    link.traits.trusted = *rc::gen::arbitrary<bool>();
    links.push_back(link);
  }
  link::score(links);
  return links;
}

inline const LinkState& link_of(const std::vector<LinkState>& links, LinkId id) {
  return *std::ranges::find(links, id, &LinkState::id);
}

struct AnyMessage {
  QoS qos;
  std::vector<std::size_t> variant_bytes;
  std::vector<VariantCost> costs;
  std::uint8_t earlier_communications = 0;
  std::vector<LevelProfile> levels;
  Guidance guidance;

  AnyMessage() {
    qos.deadline = std::chrono::milliseconds(*rc::gen::inRange(1, 500));
    qos.period = std::chrono::milliseconds(*rc::gen::inRange(0, 200));
    qos.message_class = *rc::gen::element(MessageClass::kData, MessageClass::kResult);
    const auto count = *rc::gen::inRange<std::size_t>(1, kMaxVariants + 1);
    for (std::size_t i = 0; i < count; ++i) {
      variant_bytes.push_back(*rc::gen::inRange<std::size_t>(0, 1'000'000));
    }
    std::ranges::sort(variant_bytes, std::greater{});
    if (*rc::gen::arbitrary<bool>()) {
      for (std::size_t i = 0; i < count; ++i) costs.push_back({any_time(), any_time()});
    }
    earlier_communications = *rc::gen::inRange<std::uint8_t>(0, 3);
    any_levels();
    guidance.degraded = *rc::gen::inRange(0, 4) == 0;
    if (*rc::gen::arbitrary<bool>()) {
      const std::size_t named = *rc::gen::inRange<std::size_t>(0, count);
      guidance.variant = static_cast<std::uint8_t>(guidance.degraded ? count - 1 : named);
    }
    if (*rc::gen::arbitrary<bool>()) guidance.time_left = 3 * any_time();
    guidance.local_quality = 0.01 * *rc::gen::inRange(0, 101);
  }
  AnyMessage(const AnyMessage&) = delete;  // guidance refers to levels
  AnyMessage& operator=(const AnyMessage&) = delete;

  Offer offer() const { return {qos, variant_bytes, costs, earlier_communications}; }

 private:
  static Duration any_time() { return std::chrono::microseconds(*rc::gen::inRange(0, 80'000)); }

  void any_levels() {
    const auto count = *rc::gen::inRange<std::size_t>(0, 5);
    for (std::size_t i = 0; i < count; ++i) {
      LevelProfile level;
      level.median = level.p95 = any_time() + Duration{1};
      const auto known = *rc::gen::inRange<std::size_t>(0, 4);
      for (std::size_t v = 0; v < known; ++v) {
        level.quality.push_back(0.01 * *rc::gen::inRange(0, 101));
      }
      levels.push_back(level);
    }
    guidance.levels = levels;
  }
};

}  // namespace interneuron::policy_test
