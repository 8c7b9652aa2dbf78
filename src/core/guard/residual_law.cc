#include "core/guard/residual_law.h"

namespace interneuron::guard {

void ResidualLaw::add(TimePoint now, const Sample& sample) {
  const std::int64_t rest = sample.rest.count();
  Loss loss{sample.round, sample.answered, bounded(sample.before.count()), bounded(rest)};
  if (sample.answered) {
    rests_.add(now, sample.key, rest);
    const std::int64_t base = *rests_.median(now, sample.key);
    loss.after = bounded(wrapping_sub(rest, base)) + bounded(sample.computed.count());
  }
  for (std::size_t i = 0; i < size_; ++i) {
    if (losses_[i].round == loss.round) {
      losses_[i] = loss;
      return;
    }
  }
  losses_[next_] = loss;
  next_ = (next_ + 1) % kRounds;
  size_ = std::min(size_ + 1, kRounds);
}

std::optional<Duration> ResidualLaw::base(TimePoint now, std::optional<std::uint8_t> key) const {
  const auto median = key ? rests_.median(now, *key) : rests_.median_of_all(now);
  return median ? std::optional(Duration{*median}) : std::nullopt;
}

double ResidualLaw::tail(Duration slack) const {
  if (slack <= Duration::zero()) return 1.0;
  const auto scale = static_cast<double>(scale_.count());
  const double share = scale / (scale + static_cast<double>(slack.count()));
  return share * share;
}

ResidualLaw::Near ResidualLaw::near(std::optional<Duration> before, Duration width) const {
  std::array<std::int64_t, kRounds> away;
  const std::int64_t middle = before ? bounded(before->count()) : 0;
  for (std::size_t i = 0; i < size_; ++i) {
    away[i] = before ? std::abs(losses_[i].before - middle) : 0;
  }
  std::int64_t reach = width.count();
  if (before && size_ > 0) {
    std::array<std::int64_t, kRounds> sorted = away;
    const auto last = sorted.begin() + static_cast<std::ptrdiff_t>(std::min(kLeast, size_) - 1);
    std::nth_element(sorted.begin(), last, sorted.begin() + static_cast<std::ptrdiff_t>(size_));
    reach = std::max(reach, *last);
  }
  Near out;
  out.law_ = this;
  for (std::size_t i = 0; i < size_; ++i) {
    if (away[i] > reach) continue;
    const float weight = 1.0F / (1.0F + static_cast<float>(age(i)) / kHalf);
    out.rounds_[out.size_++] = {losses_[i].after, weight, losses_[i].answered};
    out.weight_ += static_cast<double>(weight);
  }
  return out;
}

double ResidualLaw::Near::within(Duration slack) const {
  double sum = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    const auto& [after, weight, answered] = rounds_[i];
    const Duration left{bounded(slack.count()) - after};
    if (left < Duration::zero()) continue;
    sum += static_cast<double>(weight) * (answered ? 1.0 : 1.0 - law_->tail(left));
  }
  const double tail = size_ == 0 ? 1.0 : weight_ / static_cast<double>(law_->size_);
  return (sum + tail * (1.0 - law_->tail(slack))) / (weight_ + tail);
}

}  // namespace interneuron::guard
