#include "core/guard/residual_law.h"

#include <algorithm>

#include "core/guard/choice.h"
#include "core/guard/recent.h"

namespace interneuron::guard {
namespace {

// What was learnt is dropped after so long without news, as the bases of guard kPaper are.
constexpr Duration kForget = std::chrono::seconds(60);
// How many of the newest samples are looked through for one of the same round: a header tells of 16
// rounds, and some of them may be learnt out of order.
constexpr std::size_t kRetold = 32;
// Peers' bytes may make a difference of any size. One of more than an hour, in ns, means nothing.
constexpr std::int64_t kBound = 3'600'000'000'000;

std::int64_t bounded(std::int64_t ns) { return std::clamp(ns, -kBound, kBound); }

}  // namespace

void ResidualLaw::add(TimePoint now, const Sample& sample) {
  for (std::size_t i = 0; i < std::min(kRetold, size_); ++i) {
    Entry& known = back(i);
    if (known.sample.round != sample.round) continue;
    // The old one is a difference by now, to which this one cannot be compared.
    if (i >= fresh_) return;
    const std::uint8_t key = known.sample.key;
    known = {sample, true};
    renew(key);
    renew(sample.key);
    age(now);
    return;
  }
  if (size_ == kRounds && fresh_ == kRounds) --fresh_;
  ring_[next_] = {sample, true};
  next_ = (next_ + 1) % kRounds;
  size_ = std::min(size_ + 1, kRounds);
  ++fresh_;
  renew(sample.key);
  age(now);
}

void ResidualLaw::age(TimePoint now) {
  while (fresh_ > 0) {
    Entry& oldest = back(fresh_ - 1);
    if (fresh_ <= kFresh && now - oldest.sample.at <= kRecent) return;
    const std::uint8_t key = oldest.sample.key;
    freeze(oldest);
    --fresh_;
    renew(key);
  }
}

void ResidualLaw::freeze(Entry& entry) {
  if (!entry.fresh) return;
  entry.fresh = false;
  if (entry.sample.kind == Sample::Kind::kBeyond) return;
  const std::int64_t base = base_[entry.sample.key].value.value_or(entry.sample.rest.count());
  entry.sample.rest = Duration{bounded(wrapping_sub(entry.sample.rest.count(), base))};
}

void ResidualLaw::reconsider(const Speed& speed) {
  for (std::size_t i = 0; i < fresh_; ++i) {
    Sample& s = back(i).sample;
    if (s.kind != Sample::Kind::kKnown) continue;
    const Duration now = s.run.took - speed.expected(s.run.level, s.run.median);
    if (std::chrono::abs(now) < std::chrono::abs(s.computed)) s.computed = now;
  }
}

// Without fresh samples the last base stays.
void ResidualLaw::renew(std::uint8_t key) {
  std::array<std::int64_t, kFresh + 1> rests;
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(fresh_, rests.size()); ++i) {
    const Sample& s = back(i).sample;
    if (s.key != key || s.kind != Sample::Kind::kKnown) continue;
    if (count == 0) base_[key].at = s.at;
    rests[count++] = s.rest.count();
  }
  if (count > 0) base_[key].value = wrapping_median(rests.data(), count);
}

std::optional<Duration> ResidualLaw::base(TimePoint now, std::uint8_t key) const {
  const Base& b = base_[key];
  if (!b.value || now - *b.at > kForget) return std::nullopt;
  return Duration{*b.value};
}

double ResidualLaw::tail(Duration slack) const {
  if (slack <= Duration::zero()) return 1.0;
  const auto scale = static_cast<double>(scale_.count());
  const double share = scale / (scale + static_cast<double>(slack.count()));
  return share * share;
}

ResidualLaw::Pair ResidualLaw::pair(std::size_t i) const {
  const Entry& entry = ring_[i];
  const Sample& s = entry.sample;
  Pair out;
  out.before = bounded(s.before.count());
  out.beyond = s.kind == Sample::Kind::kBeyond;
  out.rest = s.rest.count();
  if (entry.fresh && !out.beyond) out.rest = wrapping_sub(out.rest, base_[s.key].value.value_or(0));
  out.rest = bounded(out.rest);
  out.after = out.beyond ? out.rest : out.rest + bounded(s.computed.count());
  return out;
}

ResidualLaw::Near ResidualLaw::near(std::optional<Duration> before, Duration width) const {
  Near out;
  out.law_ = this;
  const auto away = [&](std::size_t i) {
    return before ? std::abs(bounded(ring_[i].sample.before.count()) - bounded(before->count()))
                  : std::int64_t{0};
  };
  std::array<std::int64_t, kRounds> distance;
  std::size_t within = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    distance[i] = away(i);
    within += distance[i] <= width.count() ? 1U : 0U;
  }
  std::int64_t reach = width.count();
  if (within < kLeast && within < size_) {
    const std::size_t last = std::min(kLeast, size_) - 1;
    std::nth_element(distance.begin(), distance.begin() + static_cast<std::ptrdiff_t>(last),
                     distance.begin() + static_cast<std::ptrdiff_t>(size_));
    reach = distance[last];
  }
  for (std::size_t i = 0; i < size_; ++i) {
    if (away(i) > reach) continue;
    const Pair p = pair(i);
    if (p.beyond) {
      out.more_[out.beyond_++] = p.after - p.before;
    } else {
      out.rest_[out.count_] = p.rest;
      out.after_[out.count_++] = p.after;
    }
  }
  return out;
}

void ResidualLaw::drop_bases() {
  for (std::size_t i = 0; i < fresh_; ++i) freeze(back(i));
  fresh_ = 0;
  base_ = {};
}

double ResidualLaw::Near::weight_of_one() const {
  return law_->size() == 0
             ? 1.0
             : std::max(1.0, static_cast<double>(size())) / static_cast<double>(law_->size());
}

Chance ResidualLaw::Near::within(Duration slack) const {
  std::size_t hits = 0;
  for (std::size_t i = 0; i < count_; ++i) hits += after_[i] <= slack.count() ? 1U : 0U;
  double sum = static_cast<double>(hits);
  for (std::size_t i = 0; i < beyond_; ++i) {
    sum += 1.0 - law_->tail(Duration{bounded(slack.count()) - more_[i]});
  }
  const double one = weight_of_one();
  const auto all = static_cast<double>(size());
  return chance(sum, all, (sum + one * (1.0 - law_->tail(slack))) / (all + one));
}

double ResidualLaw::Near::rest_within(Duration slack) const {
  std::size_t hits = 0;
  for (std::size_t i = 0; i < count_; ++i) hits += rest_[i] <= slack.count() ? 1U : 0U;
  const double one = weight_of_one();
  return (static_cast<double>(hits) + one * (1.0 - law_->tail(slack))) /
         (static_cast<double>(count_) + one);
}

}  // namespace interneuron::guard
