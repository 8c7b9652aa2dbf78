#include "core/guard/origins.h"

#include <algorithm>

namespace interneuron::guard {
namespace {

// 1 in units of 1/1000.
constexpr std::int32_t kOne = 1000;
// X ← X - 1 at a miss, the paper's, in 1/1000.
constexpr std::int32_t kPenalty = 1000;
// X ← X + 0.2 when a round sent while recovering was on time, the paper's, in 1/1000.
constexpr std::int32_t kReward = 200;

}  // namespace

XController::Sent XController::begin(std::optional<Duration> base_n, Duration deadline) {
  if (!recovering_) {
    x_ = 0;
    if (base_n && options_.ablation.use_x) {
      // base_N <= D_N <= one hour, so the product fits.
      const std::int64_t used = base_n->count() * kOne / deadline.count();
      x_ = static_cast<std::int32_t>(
          std::clamp<std::int64_t>(kOne - used + options_.beta_permille, -kOne, INT16_MAX));
    }
  }
  Sent sent{static_cast<std::int16_t>(x_), recovering_, degrade_next_ > 0};
  if (degrade_next_ > 0) --degrade_next_;
  return sent;
}

void XController::on_time(bool sent_while_recovering) {
  if (!recovering_ || !sent_while_recovering) return;
  x_ += kReward;
  if (x_ >= 0) recovering_ = false;
}

void XController::missed() {
  if (!options_.ablation.use_handler) return;
  x_ = std::max(x_ - kPenalty, -kOne);
  recovering_ = true;
  ++degrade_next_;
}

}  // namespace interneuron::guard
