// A plan by variants: which links carry each, in which role.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "interneuron/few.h"
#include "interneuron/message.h"
#include "interneuron/policy.h"

namespace interneuron {

// Of one variant. Plain values; pure.
struct Carriers {
  std::uint8_t variant = 0;
  // The links that it sets out over: each carries all of it or, where it is divided, a share. Empty
  // for a variant that only stands by.
  Few<LinkId, kMaxLinks> links{};
  bool divided = false;
  // The links that may carry repair symbols of it, and those over which what is missing goes when
  // it seems late.
  Few<LinkId, kMaxLinks> parity{};
  Few<LinkId, kMaxLinks> shadow{};

  bool sets_out() const { return !links.empty(); }
};

// The variants of a plan, from the best to the smallest. On the stack alone.
class Itinerary {
 public:
  const Carriers* begin() const { return items_.data(); }
  const Carriers* end() const { return items_.data() + size_; }
  void push_back(const Carriers& c) { items_[size_++] = c; }

 private:
  std::array<Carriers, kMaxVariants> items_{};
  std::size_t size_ = 0;
};

// Of a plan that plan_message() has made safe.
inline Itinerary carriers_of(const Plan& plan) {
  Itinerary out;
  for (std::uint8_t v = 0; v < kMaxVariants; ++v) {
    Carriers c;
    c.variant = v;
    for (const Assignment& send : plan.sends) {
      if (send.variant != v) continue;
      switch (send.role) {
        case SendRole::kShare:
          c.divided = true;
          [[fallthrough]];
        case SendRole::kWhole:
          c.links.push_back(send.link);
          break;
        case SendRole::kParity:
          c.parity.push_back(send.link);
          break;
        case SendRole::kShadow:
          c.shadow.push_back(send.link);
          break;
      }
    }
    if (c.sets_out() || !c.shadow.empty()) out.push_back(c);
  }
  return out;
}

// The best variant that sets out; of a plan with sends.
inline std::uint8_t best_planned(const Plan& plan) {
  for (const Carriers& c : carriers_of(plan)) {
    if (c.sets_out()) return c.variant;
  }
  return 0;
}

}  // namespace interneuron
