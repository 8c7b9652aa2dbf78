// Links and offers for the tests of policies.
#pragma once

#include <gmock/gmock.h>

#include <array>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "core/link/nature.h"
#include "interneuron/policy.h"

namespace interneuron::policy_test {

inline const Policy* find_policy(const PolicySet& policies, std::string_view name) {
  for (const auto& policy : policies) {
    if (policy->name() == name) return policy.get();
  }
  return nullptr;
}

// A link that is up: 0 = not measured yet.
struct Up {
  std::uint8_t id = 0;
  int rtt_ms = 0;
  double mbit = 0;
};

inline std::vector<LinkState> make_links(std::initializer_list<Up> up,
                                         std::initializer_list<std::uint8_t> down = {}) {
  std::vector<LinkState> links;
  for (const std::uint8_t id : down) {
    LinkState link{
        .id = LinkId{id}, .rtt_p95 = std::chrono::milliseconds(1), .rate = DataRate::mbit(1000)};
    links.push_back(link);
  }
  for (const Up& u : up) {
    LinkState link{.id = LinkId{u.id},
                   .up = true,
                   .rtt_p95 = std::chrono::milliseconds(u.rtt_ms),
                   .rate = DataRate::mbit(u.mbit)};
    links.push_back(link);
  }
  link::score(links);
  return links;
}

// The paper's images at 10 Hz: raw needs 41.9 Mbit/s, sampled 10.5.
inline constexpr std::array<std::size_t, 2> kRawAndSampled{512 * 1024, 128 * 1024};

inline QoS frames_at_10_hz() {
  return {.deadline = std::chrono::milliseconds(130), .period = std::chrono::milliseconds(100)};
}

// The paper's three models, lowest first: weights n, l, x6 on raw and sampled images.
inline std::vector<LevelProfile> three_levels() {
  using std::chrono::milliseconds;
  return {{milliseconds(8), milliseconds(10), {0.136, 0.128}},
          {milliseconds(19), milliseconds(24), {0.348, 0.327}},
          {milliseconds(44), milliseconds(48), {0.396, 0.383}}};
}

struct Case {
  const char* name;
  std::vector<std::size_t> variant_bytes;
  std::vector<LinkState> links;
  bool degraded;
  Assignments sends;
  bool under_floor;
};

// What leaves at once; roles_test.cc looks at what helps.
inline Assignments setting_out(const Plan& plan) {
  Assignments out;
  for (const Assignment& a : plan.sends) {
    if (a.role == SendRole::kWhole || a.role == SendRole::kShare) out.push_back(a);
  }
  return out;
}

inline void check(std::string_view policy_name, const std::vector<Case>& cases) {
  const PolicySet policies = builtin_policies();
  const Policy* policy = find_policy(policies, policy_name);
  ASSERT_NE(policy, nullptr);
  for (const Case& c : cases) {
    SCOPED_TRACE(c.name);
    const Plan plan = policy->plan({frames_at_10_hz(), c.variant_bytes}, c.links, {c.degraded});
    EXPECT_EQ(setting_out(plan), c.sends);
    EXPECT_EQ(plan.under_floor, c.under_floor);
  }
}

inline Assignment send(int variant, int link) {
  return {static_cast<std::uint8_t>(variant), LinkId{static_cast<std::uint8_t>(link)}};
}

}  // namespace interneuron::policy_test

namespace interneuron {

inline void PrintTo(const Assignment& a, std::ostream* out) {
  *out << "variant " << int{a.variant} << " over link " << int{a.link.value} << " ("
       << to_string(a.role) << ")";
}

}  // namespace interneuron
