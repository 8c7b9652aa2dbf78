#include "core/cc/crowd_share.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>

#include "interneuron/sizes.h"

#include <cstring>
extern char** environ;
namespace interneuron::cc {
namespace {
double ENV(const char* n, double d) {
  const std::size_t l = std::strlen(n);
  for (char** e = environ; e && *e; ++e)
    if (std::strncmp(*e, n, l) == 0 && (*e)[l] == '=') return atof(*e + l + 1);
  return d;
}

constexpr Duration kSlot = std::chrono::milliseconds(4);
// The mean queue that is aimed at, in seconds: a few frames of others, which come at random times.
const double kMeanTarget = ENV("TARGET", 0.020);
// Memory of means. No measurement behind this value: a few round trips, longer than a period of a
// camera at 10 Hz.
const double kMeanMemory = ENV("MEMORY", 0.15);
const double kUsedMemory = ENV("USED", 0.5);
// Between two decisions.
const Duration kPeriod = std::chrono::milliseconds((int)ENV("PERIOD", 100));
// The rate falls by this share of it when the queue is twice the target.
const double kMeanFall = ENV("FALL", 0.25);
const double kOwn = ENV("OWN", 2);
const double kBelow = ENV("BELOW", 0.8);
const double kFloor = ENV("FLOOR", 1.15);
const double kGate = ENV("GATE", 0.05);
const double kQuick = ENV("QUICK", 1.5);
const int kPart = (int)ENV("PART", 3);
const double kJump = ENV("JUMP", 0.012);
const double kClip = ENV("CLIP", 0.03);
const double kApart = ENV("APART", .015);
const double kStrongExcess = ENV("SEX", .014);
const int kStrongs = (int)ENV("STRONGS", 2);
const double kEntry = ENV("ENTRY", .012);
const double kDebt = ENV("DEBT", 1);
const double kOthersMemory = ENV("OTHERS", 0.3);
const Duration kBetweenFalls = std::chrono::milliseconds((int)ENV("BETWEEN", 300));
const double kEnter = ENV("ENTER", 0.5);
const double kDrains = ENV("DRAINS", 0.9);
const double kTargetOne = ENV("TONE", 0.004);
const double kPower = ENV("POWER", 0.5);
const double kMostTarget = ENV("TMOST", 0.04);
const double kDice = ENV("DICE", 0.5);
const double kRise = ENV("RISE", 0.015);
const double kStep = ENV("STEP", .5);
// The newcomer's rate: ten packets a round trip (RFC 6928), of 40 ms.
const DataRate kStart{(std::int64_t)(ENV("START", 2.4)*1e6)};
const double kCrowd = ENV("CROWD", 0.008);
const double kCap = ENV("CAP", 1.5);
constexpr Duration kStretchMemory = std::chrono::seconds(1);
const Duration kAlone = std::chrono::milliseconds((int)ENV("ALONE", 2000));
constexpr DataRate kLeastShare{8 * 10 * static_cast<std::int64_t>(kMaxPacketBytes)};

double decayed(double old, double fresh, double seconds, double memory) {
  return fresh + (old - fresh) * std::exp(-seconds / memory);
}

double bytes_per_second(DataRate rate) { return static_cast<double>(rate.bits_per_second) / 8; }

}  // namespace

// --- SentBytes

void SentBytes::sent(TimePoint now, std::size_t ip_bytes) {
  if (slots_[newest_].start + kSlot <= now) {
    newest_ = (newest_ + 1) % kSlots;
    slots_[newest_] = {now, all_};
  }
  all_ += ip_bytes;
}

std::uint64_t SentBytes::before(TimePoint at) const {
  std::uint64_t next = all_;
  for (std::size_t back = 0; back < kSlots; ++back) {
    const Slot& slot = slots_[(newest_ + kSlots - back) % kSlots];
    if (slot.start <= at) return slot.start + kSlot <= at ? next : slot.before;
    next = slot.before;
  }
  return next;
}

// --- CrowdShare

double CrowdShare::saved(TimePoint now) const {
  const double most = kCap * std::max(asked_, 2.0 * kMaxPacketBytes);
  return std::min(most, saved_ + to_seconds(now - saved_at_) * bytes_per_second(*rate_));
}

void CrowdShare::sent(TimePoint now, std::size_t ip_bytes) {
  sent_.sent(now, ip_bytes);
  const double bytes = static_cast<double>(ip_bytes);
  used_ = used_ * std::exp(-to_seconds(now - used_at_) / kUsedMemory) + bytes / kUsedMemory;
  used_at_ = now;
  if (!rate_) return;
  saved_ = std::max(saved(now) - bytes, -kDebt * asked_);
  saved_at_ = now;
}

void CrowdShare::dice() {
  const auto n = (sent_.all() + 1) * 0x9e3779b97f4a7c15ULL;
  threshold_ = 1 - kDice / 2 + kDice * static_cast<double>(n >> 40) / static_cast<double>(1ULL << 24);
}

void CrowdShare::asked(TimePoint now, std::size_t best, std::size_t smallest, Duration left) {
  const Duration part =
      std::max<Duration>((left - std::chrono::duration_cast<Duration>(std::chrono::duration<double>(newest_))) / kPart, left / 8);
  asked_ = static_cast<double>(best);
  best_ = rate_of(best, part);
  smallest_ = smallest < best ? std::min(rate_of(smallest, part), rate_of(best, left).scaled(kBelow)) : DataRate{};
  const double since = std::clamp(to_seconds(now - asked_at_), 0.01, 1.0);
  asked_at_ = now;
  period_ = period_ > 0 ? period_ + (since - period_) / 4 : since;
  const double floor = kFloor * 8 * static_cast<double>(smallest) / period_;
  floor_ = smallest < best ? std::min(DataRate{static_cast<std::int64_t>(floor)}, capacity_) : DataRate{};
  granted_ = rate_ && saved(now) >= asked_ * threshold_ && newest_ < kGate;
  if (granted_) dice();
  if (rate_ && saved(now) <= -kDebt * .9 * asked_) smallest_ = {};
}

void CrowdShare::met(TimePoint now, TimePoint left_at, Duration queue) {
  const double since_left = to_seconds(left_at - left_at_);
  // No queue grows by so much so soon: what came through was held up as a whole.
  const double raw = to_seconds(queue);
  const double jump = raw - held_up_ - newest_;
  if (has_met_ && jump > kJump + 4 * std::abs(since_left)) held_up_ += jump;
  held_up_ = std::clamp(raw - newest_ > 0 ? held_up_ : std::min(held_up_, raw), 0.0, raw);
  const double met = raw - held_up_;
  if (left_at > left_at_) {
    const double own = kOwn * static_cast<double>(sent_.before(left_at) - sent_.before(left_at_)) / std::max(1.0, bytes_per_second(capacity_));
    const double excess = met - std::max(0.0, newest_ + own - since_left);
    if (own == 0 && since_left > kApart) strong_ = excess > kStrongExcess ? strong_ + 1 : excess < 0.003 ? 0 : strong_;
    if (since_left < 0.3) others_ = decayed(others_, std::clamp(excess, 0.0, kClip), since_left, kOthersMemory);
  }
  newest_ = met;
  left_at_ = left_at;
  const double since = has_met_ ? to_seconds(now - met_at_) : 1;
  mean_ = decayed(mean_, newest_, since, kMeanMemory);
  has_met_ = true;
  longest_ = std::max(longest_, newest_);
  met_at_ = now;
}

void CrowdShare::clock_stepped() {
  has_met_ = false;
  newest_ = mean_ = others_ = 0;
}

void CrowdShare::enter(TimePoint now) {
  const double used = 8 * used_ * std::exp(-to_seconds(now - used_at_) / kUsedMemory);
  rate_ = std::clamp(DataRate{static_cast<std::int64_t>(kEnter * used)}, std::min(std::max(kLeastShare, floor_), capacity_), capacity_);
  saved_ = 0;
  saved_at_ = now;
  is_new_ = false;
  granted_ = false;
  dice();
  before_ = 0;
  longest_ = newest_;
  decide_at_ = now + kPeriod;
  fall_at_ = now + kBetweenFalls;
}

void CrowdShare::decide(TimePoint now, Duration round_trip) {
  if (capacity_ <= DataRate{}) return;
  if (is_new_ && !rate_) {
    rate_ = std::min(kStart, capacity_);
    saved_ = kCap * std::max(asked_, 2.0 * kMaxPacketBytes);
    saved_at_ = now;
  }
  const bool stretched = stretched_at_ && now - *stretched_at_ < kStretchMemory;
  if (others_ > kCrowd || strong_ >= kStrongs) others_at_ = now;
  const bool seen = (others_ > kEntry || strong_ >= kStrongs) && newest_ > kMeanTarget;
  if (seen && (is_new_ || (!rate_ && stretched))) enter(now);
  if (is_new_ && newest_ > kMeanTarget) {
    is_new_ = false;
    rate_.reset();
  }
  if (newest_ > kMeanTarget / 2) queued_at_ = now;
  if (!rate_ || now < decide_at_) return;
  saved_ = saved(now);
  saved_at_ = now;
  adapt(now);
  lost_ = 0;
  decide_at_ = now + (is_new_ ? round_trip : std::max(round_trip, kPeriod));
  const bool is_ours = *rate_ >= capacity_ || mean_ > target();
  if (!is_new_ && is_ours && (!others_at_ || now - *others_at_ > kAlone)) rate_.reset();
}

double CrowdShare::target() const {
  const double others = 7.5e6 / std::max(1.0, bytes_per_second(*rate_));
  return std::clamp(kTargetOne * std::pow(others, kPower), 0.005, kMostTarget);
}

void CrowdShare::adapt(TimePoint now) {
  const double over = std::clamp(mean_ / target() - 1, -1.0, 2.0);
  const bool drains = longest_ < kDrains * before_;
  before_ = longest_;
  longest_ = newest_;
  if (over > 0) {
    if ((!drains || kDrains > 1) && now >= fall_at_) {
      // What nobody asks for is no share to fall from.
      if (period_ > 0) rate_ = std::min(*rate_, DataRate{static_cast<std::int64_t>(8 * asked_ / period_)});
      rate_ = rate_->scaled(1 - kMeanFall * std::min(1.0, over));
      fall_at_ = now + kBetweenFalls;
    }
  } else if (is_new_) {
    rate_ = rate_->scaled(2);
    if (*rate_ >= capacity_) {
      is_new_ = false;
      rate_ = capacity_;
    }
  } else {
    rate_ = rate_->scaled(1 - kRise * over * std::clamp(target() / std::max(mean_, 0.01), 1.0, kQuick));
  }
  rate_ = std::max(std::min(*rate_, capacity_), std::min(over < 2 ? std::max(kLeastShare, floor_) : kLeastShare, capacity_));
}

Duration CrowdShare::queue() const {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(std::min(mean_, newest_)));
}

DataRate CrowdShare::planned() const {
  return std::min(std::max(*rate_, granted_ ? best_ : smallest_), capacity_);
}

}  // namespace interneuron::cc
