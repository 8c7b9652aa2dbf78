#include "core/link/policed_rate.h"

#include <algorithm>
#include <cmath>

namespace interneuron::link {
namespace {

// A bucket is taken not to fill in so short a pause, which the smallest of those that are of use is
// at the least: 10 ms of its rate. Packets of one message leave no further apart where they wait
// for their pace alone.
constexpr Duration kStretchPause = std::chrono::milliseconds(10);
// A round has so many packets, and is as long as a usual round trip: a burst, which passes a full
// bucket at its begin and loses its end, is judged as one. No measurement behind these values.
constexpr std::uint32_t kRoundPackets = 64;
constexpr Duration kRoundTime = std::chrono::milliseconds(50);
// Fewer losses than this may be chance: they are counted on for ten rounds where a cap is to be
// judged.
constexpr std::uint32_t kLeastLost = 3;
constexpr std::uint32_t kUnclearPackets = 10 * kRoundPackets;
// So many may be chance where one in a hundred is lost, and a cap that was measured is not to fall
// for that: of a hundred packets eight are lost once in 10,000 times.
constexpr std::uint32_t kLostBelow = 8;
// Losses with a longer queue are those of a router's: CoDel's target (RFC 8289).
constexpr Duration kNoQueue = std::chrono::milliseconds(5);
// Much is lost: BBR's long-term sampling takes a fifth, and a pace of 1.25 times the rate
// (RateEstimator::kHeadroom) loses as much, less what a full bucket lets pass.
constexpr double kMuchLost = 0.15;
constexpr int kSuspected = 2;
// Rates are alike within an eighth, as BBR's long-term sampling has it.
constexpr double kAlike = 1.125;
// So many packets between losses are a measurement: each of the two ends of a stretch is off by up
// to one packet.
constexpr std::uint32_t kMeasured = 24;
// What is sent in less time than this leaves at once.
constexpr Duration kAtOnce = std::chrono::milliseconds(1);
// The cap in terms of what was measured, so that nothing is lost while that holds.
constexpr double kBelow = 0.98;
// It falls to no less than this at once where nothing is measured: a burst that passes a bucket
// says little of how much slower that is filled.
constexpr double kMostFall = 0.5;
constexpr DataRate kLeastCap{100'000};
// A larger share lost than this makes the cap fall. No measurement behind this value: a loaded path
// misses a message for nearly each packet lost.
constexpr double kFewLost = 0.01;
// And this times what is lost whatever the rate; up to the second of the two it may rise.
constexpr double kMoreLost = 2.0;
constexpr double kNoMoreLost = 1.5;
// More packets than this beyond half of the usual loss, below a cap that was measured, and there is
// no policer; fewer by as much, and there is one: Wald's sequential test in its simplest form. A
// share of so many times the usual one is a change and no chance.
constexpr double kVain = 5;
constexpr double kChanged = 3;
// The usual loss is the mean of that of some eight rounds, and half of that of the one that made
// the suspicion, as the rounds before may have been slower.
constexpr double kUsualGain = 1.0 / 8;
constexpr double kUsualShare = 0.5;
// The same for what is lost below a cap, and how soon that is forgotten.
constexpr double kOwnGain = 0.25;
constexpr double kForgetSeconds = 20;
// A cap stays for the first of these, for twice as long each time that it was right, and no longer
// than the second: looking for more costs messages. Then it rises, at first by 5 % a second, and
// twice as fast a second later, so that a small step is found without many losses and a large one
// soon. Where 10 s of that lose nothing, nobody polices. No measurement behind these values.
constexpr Duration kLeastStay = std::chrono::seconds(1);
constexpr Duration kMostStay = std::chrono::seconds(60);
constexpr int kStayGrowth = 8;
constexpr double kRisePerSecond = 0.05;
constexpr double kMostRisePerSecond = 1.0;
constexpr double kFreeSeconds = 10;
// A round that is judged late lets it rise no further than one of this length.
constexpr Duration kLongestRise = std::chrono::milliseconds(200);
// At the onset of losses it falls to this share of what arrived; where so small a share of the
// losses is expected, they are no chance.
constexpr double kBelowOnset = 0.95;
constexpr double kUnexpected = 0.25;
// Packets that left more slowly than this in terms of the cap do not show that it could rise.
constexpr double kUsed = 0.8;

bool is_alike(DataRate a, DataRate b) { return a < b.scaled(kAlike) && b < a.scaled(kAlike); }

}  // namespace

DataRate PolicedRate::Round::left_at() const {
  return rate_of(left_bytes, std::max(busy, kAtOnce));
}

DataRate PolicedRate::Round::arrived_at() const {
  return rate_of(arrived_bytes, std::max(busy, kAtOnce));
}

double PolicedRate::Round::beyond(DataRate rate) const {
  const double bits = to_seconds(busy) * static_cast<double>(rate.bits_per_second);
  return static_cast<double>(arrived_bytes) - bits / 8;
}

bool PolicedRate::Round::is_measured() const { return between >= kMeasured; }

// What arrived from loss to loss passed at no more than the rate, and at just that rate where the
// bucket never filled meanwhile. No more than that can have arrived of what left faster, so that
// losses by chance do not make it more; but what left more slowly was not limited by it.
DataRate PolicedRate::Round::measured() const {
  const DataRate measured = rate_of(between_bytes, std::max(between_losses, kAtOnce));
  return left_at() > measured ? std::min(arrived_at(), measured) : measured;
}

void PolicedRate::passed(TimePoint now, std::span<const Passage> packets, Duration queue) {
  for (const Passage& packet : packets) {
    if (is_complete(packet)) judge(now);
    if (packet.left_at < from_) continue;
    if (!packet.arrived) round_.queue = std::max(round_.queue, queue);
    add(packet);
  }
}

bool PolicedRate::is_complete(const Passage& next) const {
  if (round_.packets < kRoundPackets || next.left_at - round_.begin < kRoundTime) return false;
  const bool unclear = cap_ && round_.lost > 0 && round_.lost < least_lost() && !is_onset();
  return !unclear || round_.packets >= kUnclearPackets;
}

std::uint32_t PolicedRate::least_lost() const { return exact_ && !rose_ ? kLostBelow : kLeastLost; }

// Whether the cap has risen to where packets are lost of which next to none are lost below it.
bool PolicedRate::is_onset() const {
  return rose_ && round_.lost > 0 && own_loss_ * round_.packets < kUnexpected * round_.lost;
}

void PolicedRate::add(const Passage& packet) {
  const bool paused = last_at_ == TimePoint::min() || packet.left_at - last_at_ > kStretchPause;
  if (round_.packets == 0) round_.begin = packet.left_at;
  if (paused) {
    end_stretch();
  } else {
    round_.busy += packet.left_at - last_at_;
    ++round_.close;
    round_.left_bytes += packet.ip_bytes;
    if (packet.arrived) round_.arrived_bytes += packet.ip_bytes;
  }
  last_at_ = packet.left_at;
  ++round_.packets;
  if (!packet.arrived) {
    ++round_.lost;
    if (!stretch_.first_lost) stretch_.first_lost = packet.left_at;
    stretch_.last_lost = packet.left_at;
    stretch_.between = stretch_.packets;
    stretch_.between_bytes = stretch_.bytes;
  } else if (stretch_.first_lost) {
    ++stretch_.packets;
    stretch_.bytes += packet.ip_bytes;
  }
}

void PolicedRate::end_stretch() {
  if (stretch_.first_lost && stretch_.between > 0) {
    round_.between += stretch_.between;
    round_.between_bytes += stretch_.between_bytes;
    round_.between_losses += stretch_.last_lost - *stretch_.first_lost;
  }
  stretch_ = {};
}

void PolicedRate::judge(TimePoint now) {
  end_stretch();
  own_loss_ *= std::exp(-to_seconds(now - judged_at_) / kForgetSeconds);
  if (cap_) {
    follow(now);
  } else {
    usual_loss_ += (round_.share_lost() - usual_loss_) * kUsualGain;
    suspect(now);
  }
  judged_at_ = now;
  round_ = {};
}

void PolicedRate::suspect(TimePoint now) {
  const double share = round_.share_lost();
  // What leaves apart tells no rate, and overruns no bucket that fills meanwhile.
  const bool close = round_.close >= round_.packets / 2;
  const bool looks = close && share > std::max(kMuchLost, kMoreLost * own_loss_) &&
                     round_.queue < kNoQueue && round_.lost < round_.packets;
  if (!looks) {
    // What a bucket lets pass that was full says nothing against it.
    if (round_.beyond(known_) <= passed_) return;
    suspected_ = 0;
    passed_ = 0;
    known_ = {};
    return;
  }
  const bool other =
      round_.is_measured() && known_ > DataRate{} && !is_alike(known_, round_.measured());
  suspected_ = other ? 1 : suspected_ + 1;
  if (round_.is_measured()) known_ = round_.measured();
  passed_ = round_.beyond(known_);
  from_ = now;
  if (suspected_ < kSuspected) return;
  suspected_ = 0;
  passed_ = 0;
  fell_to_ = {};
  vain_ = 0;
  proved_ = false;
  usual_loss_ = std::max(usual_loss_, kUsualShare * share);
  fall(now, round_.left_at());
}

// To what this round or one before it has measured, else to what arrived of it.
void PolicedRate::fall(TimePoint now, DataRate from) {
  const double less = 1 - round_.share_lost() / 2;
  const DataRate left = std::min(from, round_.left_at());
  exact_ = round_.is_measured();
  DataRate to = std::clamp(round_.arrived_at().scaled(kBelowOnset), left.scaled(kMostFall),
                           left.scaled(less));
  if (exact_) {
    to = std::min(round_.measured().scaled(kBelow), from.scaled(less));
  } else if (!rose_ && known_ >= from.scaled(kMostFall) && known_ <= from.scaled(less)) {
    to = known_;
  }
  const bool again = is_alike(fell_to_, to);
  // A cap that falls on and on is not right yet.
  if (!again || !rose_) stays_ = kLeastStay;
  if (rose_) stays_ = std::min<Duration>(kStayGrowth * stays_, kMostStay);
  fell_to_ = to;
  if (exact_) known_ = to;
  rose_ = false;
  cap_ = std::max(to, kLeastCap);
  fell_at_ = now;
  from_ = now;
}

void PolicedRate::follow(TimePoint now) {
  const double share = round_.share_lost();
  if (exact_ && !rose_) {
    own_loss_ += (share - own_loss_) * kOwnGain;
    if (!proved_ && share <= kChanged * usual_loss_) {
      test();
      if (!proved_) return;
    }
  }
  const bool much = round_.lost >= kLeastLost && share > std::max(kFewLost, kMoreLost * own_loss_);
  if (!much && !rose_ && !exact_) own_loss_ += (share - own_loss_) * kOwnGain;
  if (much || is_onset()) {
    fall(now, *cap_);
  } else if (share > std::max(kFewLost / 2, kNoMoreLost * own_loss_)) {
    // It is about right: if it rises again, it does so slowly.
    fell_at_ = std::max(fell_at_, now - stays_);
  } else if (now - fell_at_ >= stays_ && round_.left_at() >= cap_->scaled(kUsed)) {
    rise(now);
  }
}

// Whether the losses have become fewer since packets leave more slowly.
void PolicedRate::test() {
  vain_ += round_.lost - usual_loss_ / 2 * round_.packets;
  proved_ = vain_ < -kVain;
  if (vain_ <= kVain) return;
  own_loss_ = usual_loss_;
  known_ = {};
  cap_.reset();
}

void PolicedRate::rise(TimePoint now) {
  rose_ = true;
  const double seconds = to_seconds(now - fell_at_ - stays_);
  const double speed = std::min(kRisePerSecond * std::exp2(seconds), kMostRisePerSecond);
  const double since = to_seconds(std::min<Duration>(now - judged_at_, kLongestRise));
  cap_ = cap_->scaled(std::exp(speed * since));
  if (seconds > kFreeSeconds) cap_.reset();
}

}  // namespace interneuron::link
