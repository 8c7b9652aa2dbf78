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
const double kEnter = ENV("ENTER", 0.7);
const double kDrains = ENV("DRAINS", 0.9);
const double kRise = ENV("RISE", 0.02);
const double kStep = ENV("STEP", 1);
// The newcomer's rate: ten packets a round trip (RFC 6928), of 40 ms.
const DataRate kStart{(std::int64_t)(ENV("START", 2.4)*1e6)};
const double kCrowd = ENV("CROWD", 0.010);
const double kCap = ENV("CAP", 1.25);
constexpr Duration kStretchMemory = std::chrono::seconds(1);
const Duration kAlone = std::chrono::milliseconds((int)ENV("ALONE", 2000));
constexpr DataRate kLeastShare{8 * 10 * static_cast<std::int64_t>(kMaxPacketBytes)};

std::int64_t slot_of(TimePoint at) { return at.time_since_epoch() / kSlot; }

double decayed(double old, double fresh, double seconds, double memory) {
  return fresh + (old - fresh) * std::exp(-seconds / memory);
}

double bytes_per_second(DataRate rate) { return static_cast<double>(rate.bits_per_second) / 8; }

}  // namespace

// --- OwnQueue

void OwnQueue::sent(TimePoint now, std::size_t ip_bytes, DataRate capacity) {
  const double carried = to_seconds(now - at_) * bytes_per_second(capacity);
  bytes_ = std::max(0.0, bytes_ - carried) + static_cast<double>(ip_bytes);
  at_ = now;
  const std::int64_t number = slot_of(now);
  slots_[static_cast<std::size_t>(number) % kSlots] = {number, bytes_};
}

Duration OwnQueue::at(TimePoint at, DataRate capacity) const {
  if (capacity <= DataRate{}) return {};
  const std::int64_t wanted = slot_of(at);
  double most = 0;
  for (const Slot& slot : slots_) {
    if (slot.number > wanted + 1 || slot.number < wanted - static_cast<std::int64_t>(kSlots)) continue;
    const double since = to_seconds(kSlot * (wanted - slot.number - 1));
    most = std::max(most, slot.bytes - std::max(0.0, since) * bytes_per_second(capacity));
  }
  return capacity.transmit_time(static_cast<std::size_t>(most));
}

// --- CrowdShare

double CrowdShare::saved(TimePoint now) const {
  const double most = kCap * std::max(asked_, 2.0 * kMaxPacketBytes);
  return std::min(most, saved_ + to_seconds(now - saved_at_) * bytes_per_second(*rate_));
}

void CrowdShare::sent(TimePoint now, std::size_t ip_bytes) {
  own_.sent(now, ip_bytes, capacity_);
  const double bytes = static_cast<double>(ip_bytes);
  used_ = used_ * std::exp(-to_seconds(now - used_at_) / kUsedMemory) + bytes / kUsedMemory;
  used_at_ = now;
  if (!rate_) return;
  saved_ = std::max(saved(now) - bytes, -kCap * asked_);
  saved_at_ = now;
}

void CrowdShare::asked(TimePoint now, std::size_t bytes, DataRate needed) {
  asked_ = static_cast<double>(bytes);
  needed_ = needed;
  granted_ = rate_ && saved(now) >= asked_;
}

void CrowdShare::met(TimePoint now, TimePoint left_at, Duration queue) {
  newest_ = to_seconds(queue);
  const double own = to_seconds(own_.at(left_at, capacity_));
  const double others = std::max(0.0, newest_ - 1.2 * own - 0.003);
  const double since = has_met_ ? to_seconds(now - met_at_) : 1;
  mean_ = decayed(mean_, newest_, since, kMeanMemory);
  others_ = decayed(others_, others, since, kMeanMemory);
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
  rate_ = std::clamp(DataRate{static_cast<std::int64_t>(kEnter * used)}, std::min(kStart, capacity_), capacity_);
  saved_ = 0;
  saved_at_ = now;
  is_new_ = false;
  granted_ = false;
  before_ = 0;
  longest_ = newest_;
  decide_at_ = now + kPeriod;
}

void CrowdShare::decide(TimePoint now, Duration round_trip) {
  if (capacity_ <= DataRate{}) return;
  if (is_new_ && !rate_) {
    rate_ = std::min(kStart, capacity_);
    saved_ = kCap * std::max(asked_, 2.0 * kMaxPacketBytes);
    saved_at_ = now;
  }
  const bool stretched = stretched_at_ && now - *stretched_at_ < kStretchMemory;
  if (others_ > kCrowd) others_at_ = now;
  if ((!rate_ && stretched && others_ > kCrowd) || (is_new_ && newest_ > kMeanTarget)) enter(now);
  if (newest_ > kMeanTarget / 2) queued_at_ = now;
  if (!rate_ || now < decide_at_) return;
  saved_ = saved(now);
  saved_at_ = now;
  adapt(now);
  lost_ = 0;
  decide_at_ = now + (is_new_ ? round_trip : std::max(round_trip, kPeriod));
  if (!is_new_ && *rate_ >= capacity_ && now - others_at_ > kAlone) rate_.reset();
}

void CrowdShare::adapt(TimePoint now) {
  const double over = std::clamp((mean_ - kMeanTarget) / kMeanTarget, -1.0, 1.0);
  double more = 0;
  const bool drains = longest_ < kDrains * before_;
  before_ = longest_;
  longest_ = newest_;
  if (over > 0) {
    if (!drains) rate_ = rate_->scaled(1 - kMeanFall * over);
  } else if (is_new_ || now - queued_at_ > kAlone) {
    rate_ = rate_->scaled(2);
    if (*rate_ >= capacity_) { is_new_ = false; rate_ = capacity_; }
  } else {
    more = -over * (kRise * static_cast<double>(rate_->bits_per_second) +
                    kStep * 8e7 * kMaxPacketBytes / 1e6);
  }
  const DataRate risen{rate_->bits_per_second + static_cast<std::int64_t>(more)};
  rate_ = std::max(std::min(risen, capacity_), std::min(kLeastShare, capacity_));
}

DataRate CrowdShare::burst() const { return std::clamp(needed_, *rate_, capacity_); }

DataRate CrowdShare::planned() const { return granted_ ? burst() : *rate_; }

}  // namespace interneuron::cc
