#include "core/guard/observers.h"

namespace interneuron::guard {
namespace {

constexpr std::int64_t kPermille = 1000;

}  // namespace

Duration smoothed(Duration base, Duration theta) {
  // The peer's t0 may be anything, so the difference may use all 64 bits: multiply quotient and
  // remainder apart.
  constexpr std::int64_t k = ReferenceTime::kSmoothingPermille;
  const std::int64_t difference = wrapping_sub(base.count(), theta.count());
  const std::int64_t rest = difference % kPermille * k;
  const std::int64_t half = rest < 0 ? -kPermille / 2 : kPermille / 2;
  return Duration{
      wrapping_add(theta.count(), difference / kPermille * k + (rest + half) / kPermille)};
}

void ReferenceTime::observe(RoundId round, std::size_t stage, Duration theta) {
  Entry* e = rounds_.enter(round);
  if (e == nullptr || e->settled) return;
  e->theta[stage - 1] = theta;
  e->known = static_cast<std::uint16_t>(e->known | 1U << (stage - 1));
}

void ReferenceTime::settle(TimePoint now, RoundId round, RoundState state) {
  Entry* e = rounds_.find(round);
  if (e == nullptr || e->settled || state == RoundState::kUnknown) return;
  e->settled = true;
  if (state != RoundState::kOnTime) return;
  for (std::size_t stage = 0; stage < kMaxStages; ++stage) {
    if ((e->known >> stage & 1U) == 0) continue;
    const Duration theta = e->theta[stage];
    base_[stage] = base_[stage] ? smoothed(*base_[stage], theta) : theta;
    accepted_at_ = now;
  }
}

std::optional<Duration> ReferenceTime::base(TimePoint now, std::size_t stage) {
  if (accepted_at_ && now - *accepted_at_ > kForget) reset();
  return base_[stage - 1];
}

void ReferenceTime::reset() {
  rounds_.clear();
  base_ = {};
  accepted_at_.reset();
}

}  // namespace interneuron::guard
