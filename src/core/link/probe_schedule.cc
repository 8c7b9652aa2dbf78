#include "core/link/probe_schedule.h"

#include <algorithm>
#include <cmath>

#include "core/base/earliest.h"
#include "core/base/slow_link.h"

namespace interneuron::link {
namespace {

constexpr double kBitsPerSecond = static_cast<double>(ProbeSchedule::kTrainRate.bits_per_second);
// Bits that the token bucket holds: a second of its rate, or one train if that is more, so that a
// long pause does not end in a burst of trains.
constexpr double kDepth = kBitsPerSecond;
// Bits that the first trains of a path may use at once: 32 packets and the 141 that 16 ms take at
// 100 Mbit/s are 1.98 Mbit.
constexpr double kStartBudget = 2e6;
// The first train of a path nobody has used yet: 4 ms at 100 Mbit/s.
constexpr std::uint32_t kStartTrain = 32;
// Fewer packets are no train (src/core/flow/path_receiver.cc).
constexpr std::uint32_t kLeastTrain = 3;
// The longest train takes 10 ms at 1.1 Gbit/s and 79 s of the budget.
constexpr std::uint32_t kMostTrain = 1'000;
// What a train lasts at least at its pace, over a link that carries that, with a little more than
// the dispersion that counts (RateEstimator::kMinDispersion), and so lasts 16 ms at the rate known;
// and what it lasts times its packets (RateEstimator::kMinPacketTime).
constexpr Duration kTrainLength = std::chrono::microseconds(5'334);
constexpr Duration kPacketTime = std::chrono::milliseconds(42);
// So many packets last long enough by kTrainLength.
constexpr std::uint32_t kFewPackets = 8;
static_assert(kPacketTime / kFewPackets <= kTrainLength);
// The pace of a train in terms of the known rate: a step up to three times is seen at once.
constexpr double kHeadroom = 3.0;
// The pace of a wanted train in terms of the rate that is wanted: what arrives at it is enough,
// with the 15 % that trains are off.
constexpr double kEnough = 1.25;
// Between two trains while the rate is unknown. No measurement behind this value: it only has to be
// larger than a round trip, so that the first train is answered before the next one leaves.
constexpr Duration kPause = std::chrono::milliseconds(300);
// A train that nothing is told of for so long is lost, or its path is dead
// (PathMachine::kDeadSilence).
constexpr Duration kVanished = std::chrono::seconds(4);
// Between two trains until kSettled of them make a median.
constexpr Duration kSettling = std::chrono::seconds(1);
constexpr std::size_t kSettled = 3;
// Evidence older than this is measured again. At 20 Mbit/s a train of 29 packets per 10 s takes a
// quarter of the budget.
constexpr Duration kOld = std::chrono::seconds(10);
// Between two trains when the longest one was still too short to trust: the link is faster than 1.2
// Gbit/s, its rate bounds nothing of ours, and a loop of such trains would use the whole budget for
// ever.
constexpr Duration kBeyond = std::chrono::minutes(10);
// While messages measure the rate no train is sent. Ten periods of a camera at 10 Hz.
constexpr Duration kBusy = std::chrono::seconds(1);
// Else a train goes into the first pause of this length between messages, so that it is told from
// them; or among them where none came for so long. No measurement behind the second value: it only
// has to leave time for the pauses of common periods.
constexpr Duration kPausing = std::chrono::milliseconds(20);
constexpr Duration kNoPause = std::chrono::seconds(1);
// A want holds for so long after the last message that was withheld. Ten periods of a camera at 10
// Hz.
constexpr Duration kWanted = std::chrono::seconds(1);
// A rate this much higher is another one: trains are within ±15 % of the rate.
constexpr double kFound = 1.15;
// The longest interval of wanted trains is that of the usual ones, kOld: doublings until then.
constexpr int kMostDoublings = 5;
// A path that carries this many times what messages need has plenty: they need what sends them
// within a third of their time (src/core/flow/path_view.h), so that it sends them within a twelfth,
// and a faster path would save them nothing that counts.
constexpr double kPlenty = 4.0;
// A heartbeat may leave sooner by this part of its interval, with something else: by itself it
// costs a wake-up, which costs as much as a dozen packets. No measurement behind this value: pauses
// of 5 ms are rare where messages flow.
constexpr int kSoonerPart = 10;
// Between two proofs of a latched path: four within the shortest proof window.
constexpr Duration kProof = std::chrono::milliseconds(250);

Duration seconds_of(double bits, DataRate rate) {
  return Duration{
      static_cast<std::int64_t>(std::ceil(bits * 1e9 / static_cast<double>(rate.bits_per_second)))};
}

}  // namespace

void ProbeSchedule::set_sizes(std::size_t heartbeat, std::size_t full) {
  heartbeat_bytes_ = heartbeat;
  full_bytes_ = std::max<std::size_t>(full, 1);
}

void ProbeSchedule::request_train(TimePoint now) { requested_at_ = now; }

void ProbeSchedule::want(TimePoint now, DataRate rate) {
  wanted_at_ = now;
  wanted_rate_ = rate;
}

void ProbeSchedule::active(TimePoint now) {
  if (!begun_at_) begun_at_ = now;
  active_at_ = now;
}

void ProbeSchedule::data_sent(TimePoint now) {
  if (!data_at_ || now - *data_at_ >= kPausing) paused_at_ = now;
  active_at_ = data_at_ = now;
}

void ProbeSchedule::heartbeat_sent(TimePoint now) {
  if (!begun_at_) begun_at_ = now;
  // The next one does not leave sooner for that.
  const bool is_early = heartbeat_at_ && heartbeat_due(now);
  heartbeat_at_ = is_early ? std::max(now, heartbeat_at(now)) : now;
}

// --- heartbeats

Duration ProbeSchedule::heartbeat_interval(TimePoint now) const {
  const bool is_new = !metered_ && begun_at_ && now - *begun_at_ < kNew;
  const bool is_active = active_at_ && now - *active_at_ < kActive;
  // A peer that has not answered yet is looked for at the usual pace.
  const Duration wanted = is_active            ? kActiveHeartbeat
                          : is_new             ? kNewHeartbeat
                          : metered_ && ready_ ? kMeteredHeartbeat
                                               : kIdleHeartbeat;
  const Duration bearable = slower_ > DataRate{}
                                ? slower_.scaled(kHeartbeatShare).transmit_time(heartbeat_bytes_)
                                : Duration{};
  return std::max(
      {wanted, kHeartbeatRate.transmit_time(heartbeat_bytes_), std::min(kIdleHeartbeat, bearable)});
}

TimePoint ProbeSchedule::heartbeat_at(TimePoint now) const {
  return heartbeat_at_ ? *heartbeat_at_ + heartbeat_interval(now) : now;
}

bool ProbeSchedule::heartbeat_due(TimePoint now) const {
  if (!heartbeat_at_) return true;
  // What a slow path carries is dearer than a wake-up.
  const Duration sooner =
      slower_ < kSlow ? Duration::zero() : heartbeat_interval(now) / kSoonerPart;
  return now >= heartbeat_at(now) - sooner;
}

// --- trains

// `train`: the bits of the train that comes next.
double ProbeSchedule::level(TimePoint now, double train) const {
  if (!level_at_) return kStartBudget;
  const double since = static_cast<double>((now - *level_at_).count()) / 1e9;
  const double depth = std::max(kDepth, train);
  return std::max(level_, std::min(depth, level_ + kBitsPerSecond * since));
}

void ProbeSchedule::spend(TimePoint now, std::uint32_t packets) {
  level_ = level(now, bits(train_packets(now))) - bits(packets);
  level_at_ = now;
}

double ProbeSchedule::bits(std::uint32_t packets) const {
  return 8.0 * packets * static_cast<double>(full_bytes_);
}

// A train that is due for both reasons is a wanted one.
void ProbeSchedule::train_sent(TimePoint now, std::uint32_t packets) {
  const auto wanted = wanted_train_at(now);
  if (wanted && *wanted <= now) {
    const bool found = *evidence_.rate >= wanted_from_.scaled(kFound);
    fruitless_ = found ? 0 : fruitless_ + 1;
    wanted_from_ = *evidence_.rate;
    const DataRate budget = std::min(evidence_.rate->scaled(kWantedShare), kWantedRate);
    const Duration paid = seconds_of(bits(packets), std::max(budget, DataRate{1}));
    const int doublings = std::clamp(fruitless_ - kPatience, 0, kMostDoublings);
    wanted_next_ = now + std::max(paid, kPause) * (1 << doublings);
  } else {
    spend(now, packets);
  }
  train_at_ = now;
  awaits_train_ = true;
  last_train_ = packets;
  requested_at_.reset();
}

bool ProbeSchedule::is_wanted(TimePoint now) const {
  return wanted_at_ && now - *wanted_at_ <= kWanted && !metered_ && evidence_.rate &&
         *evidence_.rate > DataRate{} && *evidence_.rate < wanted_rate_;
}

// Whether the path is in use and carries far more than its users need.
bool ProbeSchedule::is_plenty(TimePoint now) const {
  const bool in_use = active_at_ && now - *active_at_ < kActive;
  return in_use && needed_ > DataRate{} && evidence_.at &&
         *evidence_.rate >= needed_.scaled(kPlenty);
}

// Nobody waits for more than is wanted.
DataRate ProbeSchedule::train_pace(TimePoint now) const {
  const DataRate search = evidence_.rate->scaled(kHeadroom);
  if (!is_wanted(now)) return search;
  return std::clamp(wanted_rate_.scaled(kEnough), evidence_.rate->scaled(kEnough), search);
}

std::uint32_t ProbeSchedule::train_packets(TimePoint now) const {
  if (!evidence_.rate || *evidence_.rate <= DataRate{}) return kStartTrain;
  // A guess may be ten times too high; a train as long as it asks for would wait for the budget.
  if (!evidence_.at) return std::clamp(2 * last_train_, kStartTrain, kMostTrain);
  const double air = bits(1) / static_cast<double>(train_pace(now).bits_per_second);
  const double length = static_cast<double>(kTrainLength.count()) / 1e9;
  const double most = std::min<double>(std::ceil(length / air) + 1, kMostTrain);
  auto wanted = std::max(static_cast<std::uint32_t>(most), kLeastTrain);
  const double packet_time = static_cast<double>(kPacketTime.count()) / 1e9;
  while (wanted < kFewPackets && (wanted - 1) * air * wanted < packet_time) ++wanted;
  // The last train was too short to trust: what it said of the rate may be far too low as well.
  if (evidence_.trains == 0) wanted = std::max(wanted, std::min(2 * last_train_, kMostTrain));
  return wanted;
}

// A train that is due at `at` waits for a pause between messages.
TimePoint ProbeSchedule::in_a_pause(TimePoint now, TimePoint at) const {
  if (!data_at_) return at;
  if (evidence_.at && now - *evidence_.at < kBusy) return std::max(at, *data_at_ + kBusy);
  const TimePoint pause = *data_at_ + kPausing;
  // Where a rate is known, it is not worth more packets in front of those that wait.
  return std::max(at, evidence_.at ? pause : std::min(pause, paused_at_ + kNoPause));
}

// The next one of any kind leaves then at the earliest.
TimePoint ProbeSchedule::next_train() const {
  return awaits_train_ ? *train_at_ + kVanished : TimePoint::min();
}

// When a train is due, as far as there is budget for it.
std::optional<TimePoint> ProbeSchedule::usual_train_wish(TimePoint now) const {
  if (!requested_at_ && (metered_ || is_plenty(now))) return std::nullopt;
  TimePoint at = requested_at_.value_or(now);
  if (!requested_at_ && train_at_) {
    const bool fresh = evidence_.at && *evidence_.at >= *train_at_;
    if (evidence_.trains == 0) {
      at = *train_at_ + (last_train_ < kMostTrain ? kPause : kBeyond);
    } else if (evidence_.trains < kSettled) {
      at = *train_at_ + kSettling;
    } else {
      at = fresh ? *evidence_.at + kOld : *train_at_ + kOld;
    }
  } else if (!requested_at_ && evidence_.trains >= kSettled && evidence_.at) {
    at = *evidence_.at + kOld;
  }
  return in_a_pause(now, std::max(at, next_train()));
}

std::optional<TimePoint> ProbeSchedule::usual_train_at(TimePoint now) const {
  const auto at = usual_train_wish(now);
  if (!at) return std::nullopt;
  const double train = bits(train_packets(now));
  const double missing = train - level(now, train);
  return missing > 0 ? std::max(*at, now + seconds_of(missing, kTrainRate)) : at;
}

std::optional<TimePoint> ProbeSchedule::wanted_train_at(TimePoint now) const {
  if (!is_wanted(now) || !evidence_.at) return std::nullopt;
  const TimePoint at = std::max({now, wanted_next_, next_train()});
  return data_at_ ? std::max(at, *data_at_ + kPausing) : at;
}

// When a train is due, if that may be before `end`. The budget is looked at only then: it can only
// delay a train.
std::optional<TimePoint> ProbeSchedule::train_before(TimePoint now, TimePoint end) const {
  if (!ready_ || latched_) return std::nullopt;
  const auto wish = usual_train_wish(now);
  return earliest(wish && *wish < end ? usual_train_at(now) : std::nullopt, wanted_train_at(now));
}

std::optional<ProbeSchedule::Train> ProbeSchedule::train_due(TimePoint now) const {
  const auto at = train_before(now, now + Duration{1});
  if (!at || *at > now) return std::nullopt;
  Train train{train_packets(now), std::nullopt};
  if (evidence_.rate) train.pace = train_pace(now);
  return train;
}

// --- proofs

void ProbeSchedule::proof_sent(TimePoint now) {
  spend(now, 1);
  proof_at_ = now;
}

std::optional<TimePoint> ProbeSchedule::proof_time(TimePoint now) const {
  if (!latched_) return std::nullopt;
  return proof_at_ ? *proof_at_ + kProof : now;
}

bool ProbeSchedule::proof_due(TimePoint now) const {
  const auto at = proof_time(now);
  return at && now >= *at;
}

TimePoint ProbeSchedule::next_timeout(TimePoint now) const {
  const TimePoint other = *earliest(proof_time(now), heartbeat_at(now));
  return *earliest(train_before(now, other), other);
}

}  // namespace interneuron::link
