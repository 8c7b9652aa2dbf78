#include "core/cc/share_control.h"

#include <algorithm>
#include <cmath>

#include "interneuron/sizes.h"

namespace interneuron::cc {
namespace {

// The rate falls by this share of it when the queue is twice the target, and less below: SCReAM and
// GCC fall by 0.2 to 0.3 at most, once per round trip.
constexpr double kDelayFall = 0.3;
// Packets that may wait for each other before it counts as a queue: those of a small result
// (interneuron/message.h). A capacity that seems to be next to nothing makes none of it.
constexpr std::size_t kBurstPackets = 2;
constexpr Duration kLongestBurst = std::chrono::milliseconds(300);
// What is left of the rate after a round trip with losses, or marks in their place: SCReAM's is 0.7
// to 0.8 and CUBIC's 0.7.
constexpr double kLossFall = 0.8;
// The rate falls no further than to this share of the rate at which a train arrived.
constexpr double kArrivedShare = 0.9;
// A train that arrives at less than this of what it could was stretched; dispersion errs by a tenth
// (docs/constants.md, "Rate of a link").
constexpr double kStretched = 0.9;
// Losses count only with a queue above this: CoDel's target (RFC 8289), the shortest queue at which
// a router drops.
constexpr Duration kLeastQueue = std::chrono::milliseconds(5);
// A shorter train may pass between two packets of others, so that nothing of them is seen in it.
constexpr std::uint32_t kLongTrain = 16;
// And one of fewer packets than this says nothing of others at all: it fits between two of theirs.
constexpr std::uint32_t kTrainOfOthers = 5;
// While trains are short their rate bounds ours this loosely: a short one shows the share that it
// met rather than the pipe.
constexpr double kShortTrainRoom = 2.0;
// Gain of the share of marked packets, and the part of it that the rate falls by: RFC 8257,
// sections 3.3 and 4.2. It begins with one there as well, so that the first marks halve the rate.
constexpr double kMarkGain = 1.0 / 16;
constexpr double kMarkFall = 0.5;
// After so many decisions without a queue the rate rises by kQuickRise of it, as TIMELY's
// hyperactive increase does after five.
constexpr int kCalm = 5;
constexpr double kQuickRise = 0.1;
// But not so soon after a fall: whoever was in the way then would be overrun. A CUBIC flow at 30
// Mbit/s and 50 ms is back where it was after some 4 s (RFC 9438); half of that keeps shares with
// one fair in `interneuron bench load cubic`, a second does not.
constexpr Duration kQuickAfter = std::chrono::seconds(2);
// The pace in terms of the rate where there is room: RateEstimator::kHeadroom. And where the queue
// is half as much again as the target; below half of the target the first holds, in between in
// proportion.
constexpr double kPaceGain = 1.25;
constexpr double kDrainGain = 0.8;
// The pace while we are overloaded: what leaves sooner than the path carries it only waits there,
// and a short buffer loses it. BBRv2 cruises at 1.0; a little more keeps a path full whose rate is
// underestimated.
constexpr double kLoadedGain = 1.05;
// Memory of the duty. No measurement behind this value: two periods of a camera at 10 Hz and some.
constexpr Duration kDutyMemory = std::chrono::milliseconds(250);
// Above this duty we are overloaded.
constexpr double kOverload = 0.9;
// How long a fall and a loss are remembered. No measurement behind this value: it only has to be
// longer than the pauses between frames.
constexpr Duration kMemory = std::chrono::seconds(1);
// A round trip this little above the least one counts as without a queue.
constexpr Duration kNearBase = ShareControl::kTarget / 8;
// A sender that never pauses sees its own queue in every round trip and would take it for the
// path's length once the window of the minimum is over. So where no round trip was near the minimum
// for so long, it lets the path run empty once, as BBR does every 10 s.
constexpr Duration kDrainEvery = std::chrono::seconds(4);
// The target stays this far below a queue that lost packets, as a divisor of it, and is no shorter
// than kLeastTarget: neither a loss of the radio's nor a flow that fills the buffer may take it
// away. It comes back by kTargetRise per
// decision, which is 1 ms a second at a round trip of 50 ms. No measurement behind these values;
// with them a lone sender loses next to nothing on a buffer of 30 ms, and shares it with a CUBIC
// flow (`interneuron bench load`).
constexpr int kRoomDivisor = 10;
constexpr Duration kLeastTarget = 3 * ShareControl::kTarget / 4;
constexpr Duration kTargetRise = std::chrono::microseconds(50);
// A round trip and a queue that are longer are no queue's.
constexpr Duration kLongestExchange = std::chrono::seconds(10);
// The shortest time between two decisions: two feedbacks (src/core/peers/feedback_due.h).
constexpr Duration kLeastRound = std::chrono::milliseconds(10);
// A longer pause says no more of the duty than this.
constexpr Duration kLongestPause = std::chrono::seconds(1);
// A share that nothing was sent with for so long is forgotten. No measurement behind this value: it
// is longer than the pauses of an application that is in use, and than kQuickAfter.
constexpr Duration kForget = std::chrono::seconds(3);
// The rate falls no further: a full packet every 100 ms, or several would be on their way before
// the next sign of the queue.
constexpr DataRate kLeastRate{8 * 10 * static_cast<std::int64_t>(kMaxPacketBytes)};
// Two packets leave while the acknowledgement of two others is on its way.
constexpr std::size_t kLeastWindow = 4 * kMaxPacketBytes;

DataRate plus(DataRate rate, double bits_per_second) {
  return DataRate{rate.bits_per_second + static_cast<std::int64_t>(bits_per_second)};
}

}  // namespace

void ShareControl::report(TimePoint now, const Report& report) {
  // A sender that paused has let the path run empty: its next burst is not to be held low for that.
  if (now - used_at_ > kMemory) near_base_at_ = now;
  if (report.capacity) note_capacity(now, *report.capacity);
  if (report.round_trip) {
    note_round_trip(now, *report.round_trip);
    used_at_ = now;
    crowd_.told();
  }
  if (report.one_way_us) {
    note_one_way(now, *report.one_way_us);
    crowd_.met(now, now - std::min(round_trip_, kLongestExchange),
               std::clamp<Duration>(queue_, Duration::zero(), kLongestExchange));
  }
  aggregation_.arrived(now, report.arrived, capacity_);
  note_duty(now, report.backlog);
  if (report.train) note_train(now, *report.train);
  needed_ = report.needed;
  seen_.lost += report.lost;
  const std::uint32_t told = report.lost + report.marked;
  if (told > 0) crowd_.lost(now, told, round_trip_);
  seen_.ect += report.ect;
  seen_.marked += report.marked;
  // What left before the rate fell was marked by the same queue.
  if (now - round_trip_ >= answered_marks_at_) seen_.newly_marked += report.marked;
  seen_.held_back = seen_.held_back || report.held_back;
  if (!rate_) return;
  if (share(now)) return;
  if (seen_.held_back && now - near_base_at_ > kDrainEvery) {
    drain_until_ = now + round_trip_ + base_ / 2;
    near_base_at_ = now;
  }
  draining_ = now < drain_until_;
  forget_unused(now);
  rate_ = std::min(*rate_, most());
  if (now >= decide_at_ && seen_.queue != Duration::max()) decide(now);
  lost_lately_ = lost_at_ && now - *lost_at_ < kMemory;
}

// Whether others use the path as well, so that the rate is a share of it.
bool ShareControl::share(TimePoint now) {
  const bool was = crowd_.is_crowded();
  crowd_.decide(now, std::max(round_trip_, kLeastRound));
  if (crowd_.is_crowded()) {
    rate_ = std::min(crowd_.rate(), capacity_.scaled(kShortTrainRoom));
    seen_ = {};
    gain_ = kPaceGain;
  } else if (was) {
    rate_ = capacity_;
  }
  return crowd_.is_crowded();
}

void ShareControl::asked(TimePoint now, std::size_t best, std::size_t smallest, Duration deadline,
                         Duration least_round_trip) {
  crowd_.asked(now, best, smallest, std::max<Duration>(deadline - base_ / 2, Duration{1}),
               least_round_trip);
}

// When the packet left and how long it took is the peer's word, so it may be anything.
void ShareControl::exchange(TimePoint now, TimePoint left_at, Duration one_way) {
  const Duration ago{
      wrapping_sub(now.time_since_epoch().count(), left_at.time_since_epoch().count())};
  if (ago < Duration::zero() || ago > kLongestExchange || left_at <= exchanged_at_) return;
  exchanged_at_ = left_at;
  least_exchange_.add(now, one_way.count());
  const Duration above{
      wrapping_sub(one_way.count(), least_of(now, least_exchange_).value_or(one_way.count()))};
  crowd_.met(now, left_at, std::clamp<Duration>(above, Duration::zero(), kLongestExchange));
  if (rate_) share(now);
}

void ShareControl::note_capacity(TimePoint now, DataRate capacity) {
  const bool is_new = capacity != capacity_;
  capacity_ = capacity;
  crowd_.set_capacity(capacity);
  // The first measurement, and one that was made while nobody was in the way, is all ours.
  const bool alone = queue_ < kTarget / 4 && duty_ < 0.5 && !gave_way(now);
  if (!rate_ || (is_new && alone && capacity > *rate_)) rate_ = capacity;
}

// Beside others that never let the queue run empty what it was before them is kept in mind.
std::optional<std::int64_t> ShareControl::least_of(TimePoint now, link::WindowedMinimum& delays) {
  const std::optional<std::int64_t> least = delays.get(now);
  if (least && crowd_.competes()) delays.add(now, *least);
  return least;
}

void ShareControl::note_round_trip(TimePoint now, Duration round_trip) {
  least_round_trip_.add(now, round_trip.count());
  round_trip_ = round_trip;
  base_ = Duration{least_of(now, least_round_trip_).value_or(round_trip.count())};
}

void ShareControl::note_one_way(TimePoint now, std::uint32_t one_way_us) {
  // The difference of two delays is far less than half of what wraps.
  const auto more = static_cast<std::int32_t>(one_way_us - one_way_us_.value_or(one_way_us));
  // A queue grows no faster than time goes by, from when the packet left that was told of last; a
  // round trip more is for what overtakes.
  if (std::chrono::microseconds(more) > now - one_way_sent_at_ + round_trip_) clock_stepped();
  one_way_sent_at_ = now - round_trip_;
  one_way_ += more;
  one_way_us_ = one_way_us;
  least_one_way_.add(now, one_way_);
  queue_ = std::chrono::microseconds(one_way_ - least_of(now, least_one_way_).value_or(one_way_));
  seen_.queue = std::min(seen_.queue, queue_);
  if (queue_ <= kNearBase) near_base_at_ = now;
}

void ShareControl::clock_stepped() {
  least_exchange_ = {};
  crowd_.clock_stepped();
  least_one_way_ = {};
  one_way_us_.reset();
  seen_.queue = Duration::max();
}

void ShareControl::marks_were_false() {
  if (rate_) rate_ = capacity_;
  fell_at_.reset();
  seen_.marked = 0;
}

void ShareControl::note_duty(TimePoint now, Duration backlog) {
  const Duration since = std::min<Duration>(now - reported_at_.value_or(now), kLongestPause);
  reported_at_ = now;
  if (since <= Duration::zero()) return;
  const double share = std::clamp(to_seconds(backlog) / to_seconds(since), 0.0, 1.0);
  duty_ = share + (duty_ - share) * std::exp(-to_seconds(since) / to_seconds(kDutyMemory));
}

void ShareControl::note_train(TimePoint now, const Train& train) {
  const Duration own = train.arrived_at.transmit_time(train.packets * kMaxPacketBytes);
  if (train.arrived_at > DataRate{}) crowd_.train_waited(train.waited - own);
  // What the train could have arrived at.
  const DataRate possible = train.sent_at ? std::min(*train.sent_at, capacity_) : capacity_;
  if (train.packets < 2 || possible <= DataRate{}) return;
  long_trains_ = train.packets >= kLongTrain;
  seen_.long_train = seen_.long_train || long_trains_;
  seen_.stretched = train.arrived_at < possible.scaled(kStretched);
  seen_.arrived_at = train.arrived_at;
  if (seen_.stretched && train.packets >= kTrainOfOthers) crowd_.stretched(now);
}

// The most that the rate may be.
DataRate ShareControl::most() const {
  return overloaded() && !long_trains_ ? capacity_.scaled(kShortTrainRoom) : capacity_;
}

void ShareControl::decide(TimePoint now) {
  adapt_target();
  note_marks();
  const Duration target = std::max(target_, burst());
  const double over = std::min(1.0, to_seconds(seen_.queue - target) / to_seconds(target));
  const double factor = 1 - kDelayFall * std::max(over, 0.0);
  // Where nobody else was seen, a train that is stretched tells of a pipe that has become slower:
  // what waits there is our own, and the capacity follows.
  const bool is_alone = crowd_.is_alone(now);
  const bool is_queue = (seen_.stretched && !is_alone) || overloaded();
  // Small messages that leave at once show no stretch. They may slow down without harm, but not
  // below the rate that brings them in time.
  const bool may_be_queue = !seen_.long_train && seen_.lost == 0;
  if (over > 0 && is_queue) {
    fall(now, factor, floor());
  } else if (over > 0 && may_be_queue) {
    fall(now, factor, needed_);
  } else if (seen_.lost > 0 && seen_.queue > kLeastQueue && (is_queue || !seen_.long_train)) {
    fall(now, kLossFall, floor());
  } else if (seen_.marked == 0 && (seen_.held_back || seen_.queue < kTarget / 4) &&
             seen_.queue < target) {
    rise(now);
    if (is_alone && !overloaded()) rate_ = most();
  }
  if (seen_.newly_marked > 0) answer_marks(now);
  if (seen_.lost > 0) lost_at_ = now;
  // Without a queue the path may carry more than we know: whoever hurries finds that out.
  gain_ = overloaded() && seen_.queue > kTarget / 4 ? kLoadedGain : kPaceGain;
  // A queue for L4S is no longer than what hurries for one round trip adds to it.
  if (seen_.marked > 0) marked_at_ = now;
  if (marked(now)) gain_ = std::min(gain_, kLoadedGain);
  if (gave_way(now)) {
    const double queue = std::clamp(to_seconds(seen_.queue) / to_seconds(kTarget), 0.5, 1.5);
    gain_ = std::min(gain_, kPaceGain - (kPaceGain - kDrainGain) * (queue - 0.5));
  }
  seen_ = {};
  decide_at_ = now + std::max(round_trip_, kLeastRound);
}

// What a burst of ours of a few packets waits for itself, which is no sign of others: next to
// nothing but on a slow path, where one packet takes as long as the target.
Duration ShareControl::burst() const {
  return std::min<Duration>(capacity_.transmit_time(kBurstPackets * kMaxPacketBytes),
                            kLongestBurst);
}

// The rate falls no further for a queue, unless it is ours to drain.
DataRate ShareControl::floor() const {
  return overloaded() ? DataRate{} : seen_.arrived_at.scaled(kArrivedShare);
}

bool ShareControl::marked(TimePoint now) const { return marked_at_ && now - *marked_at_ < kMemory; }

void ShareControl::note_marks() {
  if (seen_.ect == 0) return;
  const double share = static_cast<double>(seen_.marked) / static_cast<double>(seen_.ect);
  marked_ += kMarkGain * (share - marked_);
}

// A queue for L4S marks all that waits for a millisecond or so, which is answered in proportion
// (RFC 9331, section 4.3), and is empty as soon as we send less than what arrives. A longer queue
// is a classic one, which marks a packet where it would have dropped it (RFC 3168, section 5).
void ShareControl::answer_marks(TimePoint now) {
  if (seen_.queue > kLeastQueue) {
    fall(now, kLossFall, seen_.long_train ? floor() : needed_);
  } else {
    fall(now, 1 - kMarkFall * marked_,
         seen_.long_train ? seen_.arrived_at.scaled(kArrivedShare) : needed_);
  }
  answered_marks_at_ = now;
}

// Where packets are lost in a queue that is shorter than the target, the buffer is: aiming beyond
// it only loses more.
void ShareControl::adapt_target() {
  const bool overflows = seen_.lost > 0 && seen_.queue > kLeastQueue && seen_.queue < kTarget;
  if (overflows) {
    target_ = std::clamp<Duration>(seen_.queue - seen_.queue / kRoomDivisor, kLeastTarget, target_);
  } else {
    target_ = std::min(kTarget, target_ + kTargetRise);
  }
}

// What was learnt while something was sent says nothing of now; and where a message is withheld
// because the share is too small for it, nothing would ever be learnt again.
void ShareControl::forget_unused(TimePoint now) {
  if (now - used_at_ > kForget) rate_ = capacity_;
}

void ShareControl::fall(TimePoint now, double factor, DataRate floor) {
  rate_ = std::max({rate_->scaled(factor), std::min(*rate_, floor), std::min(*rate_, kLeastRate)});
  fell_at_ = now;
  calm_ = 0;
}

void ShareControl::rise(TimePoint now) {
  const bool undisturbed = !fell_at_ || now - *fell_at_ > kQuickAfter;
  ++calm_;
  double more =
      8 * static_cast<double>(kMaxPacketBytes) / to_seconds(std::max(round_trip_, kLeastRound));
  if (seen_.queue < kTarget / 4 && calm_ > kCalm && undisturbed) {
    more = std::max(more, kQuickRise * static_cast<double>(rate_->bits_per_second));
  }
  rate_ = std::min(most(), plus(*rate_, more));
}

bool ShareControl::overloaded() const { return duty_ > kOverload; }

bool ShareControl::gave_way(TimePoint now) const { return fell_at_ && now - *fell_at_ < kMemory; }

std::optional<DataRate> ShareControl::planned() const {
  if (crowd_.is_held_low()) return std::min(rate_.value_or(crowd_.smallest()), crowd_.smallest());
  return crowd_.is_crowded() ? crowd_.planned() : rate_;
}

std::optional<DataRate> ShareControl::soon(TimePoint now) const {
  if (crowd_.is_crowded()) return crowd_.planned();
  return rate_ && queue_ < kTarget / 2 && !gave_way(now) ? capacity_ : rate_;
}

std::optional<DataRate> ShareControl::pace() const {
  if (crowd_.is_crowded()) return crowd_.planned();
  const bool all_ours = rate_ && *rate_ >= capacity_ && gain_ >= kPaceGain && !lost_lately_;
  if (!rate_ || all_ours || gain_ == 0) return std::nullopt;
  return rate_->scaled(gain_);
}

// The least round trip of late has the queue in it that others keep up.
Duration ShareControl::least_one_way(Duration least_round_trip) const {
  if (!crowd_.is_crowded()) return least_round_trip / 2;
  return (crowd_.competes() ? std::min(least_round_trip, base_) : least_round_trip) / 2 +
         crowd_.waited();
}

std::size_t ShareControl::window() const {
  if (!rate_) return SIZE_MAX;
  const DataRate rate = crowd_.is_crowded() ? crowd_.planned() : *rate_;
  const bool granted = aggregation_.mean() > target_ && !crowd_.is_crowded();
  const Duration waits = granted ? aggregation_.mean() + target_ : target_;
  const Duration full = (crowd_.competes() ? round_trip_ : base_) + waits;
  const Duration span = draining_ ? base_ / 2 : full;
  const double bytes = static_cast<double>(rate.bits_per_second) * to_seconds(span) / 8;
  return std::max(kLeastWindow, static_cast<std::size_t>(bytes));
}

}  // namespace interneuron::cc
