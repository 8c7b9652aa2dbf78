#include "core/link/policed_rate.h"

#include <algorithm>
#include <cmath>

#include "interneuron/sizes.h"

namespace interneuron::link {
namespace {

constexpr Duration kStretchPause = std::chrono::milliseconds(10);
constexpr std::uint32_t kRoundPackets = 64;
constexpr Duration kRoundTime = std::chrono::milliseconds(50);
constexpr double kUsualGain = 1.0 / 8;
constexpr Duration kLongestMemory = std::chrono::minutes(10);
constexpr Duration kNoQueue = std::chrono::milliseconds(5);
constexpr double kMuchLost = 0.15;
constexpr double kFewLost = 0.01;
constexpr std::uint32_t kUnclearPackets = 640;
constexpr double kChanged = 3;
constexpr double kGrowLoss = 1.5;
constexpr double kFreeSeconds = 10;
constexpr double kUsualShare = 0.5;
constexpr double kOwnGain = 0.25;
constexpr std::uint32_t kLeastLost = 3;
constexpr int kSuspected = 2;
constexpr double kVain = 5;
constexpr std::uint32_t kStretchPackets = 24;
constexpr double kBelow = 0.98;
constexpr double kAlike = 1.125;
constexpr Duration kLeastHold = std::chrono::milliseconds(500);
constexpr Duration kMostHold = std::chrono::seconds(4);
constexpr double kUsed = 0.8;
constexpr double kMostFall = 0.5;
constexpr double kRisePerSecond = 0.05;
constexpr Duration kLongestRise = std::chrono::milliseconds(200);
constexpr DataRate kLeastCap{100'000};
constexpr Duration kLeastBusy = std::chrono::milliseconds(1);
constexpr double kForgetSeconds = 20;

}  // namespace

void PolicedRate::passed(TimePoint now, std::span<const Passage> packets, Duration queue) {
  for (const Passage& packet : packets) {
    if (packet.left_at < from_) continue;
    const bool unclear = cap_ && round_.lost > 0 && round_.lost < kLeastLost && round_.packets < kUnclearPackets;
    const bool full = round_.packets >= kRoundPackets && packet.left_at - round_.begin >= kRoundTime;
    if (full && !unclear) judge(now);
    if (round_.packets == 0) round_.begin = packet.left_at;
    if (!packet.arrived) round_.longest_queue = std::max(round_.longest_queue, queue);
    if (packet.left_at >= from_) add(packet);
  }
}

void PolicedRate::add(const Passage& packet) {
  const Duration gap = last_at_ == TimePoint::min() ? Duration::max() : packet.left_at - last_at_;
  last_at_ = packet.left_at;
  ++round_.packets;
  if (!packet.arrived) ++round_.lost;
  if (gap <= kStretchPause) {
    round_.busy += gap;
    round_.left_bytes += packet.ip_bytes;
    if (packet.arrived) round_.arrived_bytes += packet.ip_bytes;
  } else {
    end_stretch();
  }
  add_to_stretch(packet);
}

void PolicedRate::add_to_stretch(const Passage& packet) {
  if (packet.arrived) {
    if (stretch_.first_lost) {
      ++stretch_.packets;
      stretch_.bytes += packet.ip_bytes;
    }
  } else {
    if (!stretch_.first_lost) stretch_.first_lost = packet.left_at;
    stretch_.last_lost = packet.left_at;
    stretch_.told_packets = stretch_.packets;
    stretch_.told_bytes = stretch_.bytes;
  }
}

void PolicedRate::end_stretch() {
  if (stretch_.told_packets > 0) {
    round_.told_packets += stretch_.told_packets;
    round_.told_bytes += stretch_.told_bytes;
    round_.told += stretch_.last_lost - *stretch_.first_lost;
  }
  stretch_ = {};
}

void PolicedRate::judge(TimePoint now) {
  end_stretch();
  own_loss_ *= std::exp(-to_seconds(std::min<Duration>(now - judged_at_, kLongestMemory)) / kForgetSeconds);
  if (!cap_) usual_loss_ += (round_.share_lost() - usual_loss_) * kUsualGain;
  if (cap_) {
    follow(now);
  } else {
    suspect(now);
  }
  judged_at_ = now;
  round_ = {};
}

DataRate PolicedRate::left_at() const {
  return rate_of(round_.left_bytes, std::max(round_.busy, kLeastBusy));
}

DataRate PolicedRate::measured() const {
  const DataRate arrived = rate_of(round_.arrived_bytes, std::max(round_.busy, kLeastBusy));
  if (!is_measured()) return arrived;
  return std::min(arrived, rate_of(round_.told_bytes, std::max(round_.told, kLeastBusy)));
}

bool PolicedRate::is_alike(DataRate rate) const {
  return rate < known_.scaled(kAlike) && known_ < rate.scaled(kAlike);
}

bool PolicedRate::is_measured() const { return round_.told_packets >= kStretchPackets; }

void PolicedRate::suspect(TimePoint now) {
  const double share = round_.share_lost();
  const bool looks = share > std::max(kMuchLost, 2 * own_loss_) &&
                     round_.longest_queue < kNoQueue && round_.lost < round_.packets;
  if (!looks) known_ = {};
  const bool alike = !is_measured() || known_ == DataRate{} || is_alike(measured());
  if (is_measured()) known_ = measured();
  suspected_ = looks ? (alike ? suspected_ + 1 : 1) : 0;
  if (looks) from_ = now;
  if (suspected_ < kSuspected) return;
  suspected_ = 0;
  vain_ = 0;
  proved_ = false;
  usual_loss_ = std::max(usual_loss_, kUsualShare * share);
  hold_ = kLeastHold;
  fall(now, left_at());
}

// No further than to half at once, unless enough was seen to know it.
void PolicedRate::fall(TimePoint now, DataRate from) {
  const double share = round_.share_lost();
  DataRate to = std::clamp(measured(), from.scaled(kMostFall), from.scaled(1 - share / 2));
  if (is_measured()) {
    to = std::min(measured().scaled(kBelow), from.scaled(1 - share / 2));
    hold_ = is_alike(to) ? std::min<Duration>(2 * hold_, kMostHold) : kLeastHold;
    known_ = to;
  }
  exact_ = is_measured();
  rose_ = false;
  cap_ = std::max(to, kLeastCap);
  fell_at_ = now;
  from_ = now;
}

void PolicedRate::follow(TimePoint now) {
  const double share = round_.share_lost();
  if (exact_ && !rose_) {
    own_loss_ += (share - own_loss_) * kOwnGain;
    const bool changed = share > kChanged * usual_loss_;
    if (!proved_ && !changed) {
      vain_ += round_.lost - usual_loss_ / 2 * round_.packets;
      proved_ = vain_ < -kVain;
      if (vain_ > kVain) {
        own_loss_ = usual_loss_;
        cap_.reset();
      }
      if (!proved_) return;
    }
  }
  if (round_.lost >= kLeastLost && share > std::max(kFewLost, 2 * own_loss_)) {
    return fall(now, *cap_);
  }
  if (share > std::max(kFewLost / 2, kGrowLoss * own_loss_)) {
    fell_at_ = std::max(fell_at_, now - hold_);
    return;
  }
  const double seconds = to_seconds(now - fell_at_ - hold_);
  if (seconds < 0 || left_at() < cap_->scaled(kUsed)) return;
  rose_ = true;
  const double since = to_seconds(std::min<Duration>(now - judged_at_, kLongestRise));
  cap_ = cap_->scaled(std::exp(std::min(kRisePerSecond * std::exp2(seconds), 1.0) * since));
  if (seconds > kFreeSeconds) cap_.reset();
}

}  // namespace interneuron::link
