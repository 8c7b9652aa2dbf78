#include "core/messages/on_time_forecast.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/messages/on_time_weights.h"

namespace interneuron {
namespace {

// Weights of the newest message in the share on time, and in excess and spread: records of some 30
// and 12 messages. Chosen on the seeds that the weights were fitted on, as all values here.
constexpr double kKeep = 0.97;
constexpr double kNewest = 0.08;
// How far a prediction that was wrong shifts the next ones, in log-odds, and the largest shift:
// some 100 misses of what seemed sure make them unlikely, and as many messages on time make them
// likely again.
constexpr double kShiftBy = 0.05;
constexpr double kMostShift = 6;
// What the record of a peer begins with: a message, and which share of it was on time.
constexpr double kPriorMessages = 1;
constexpr double kPriorOnTime = 0.9;
// The share is kept from certainty, and its log-odds are scaled to [-1, 1].
constexpr double kLeastShare = 0.005;
constexpr double kMostLogOdds = 5.3;
// Excesses are bounded by this, in seconds: a peer's clock may be far off.
constexpr double kMostExcess = 0.5;
// A message that was not there exceeds its slack by this part of its deadline.
constexpr double kMissedBy = 0.2;
// Seconds: of a scale that may be 0; from an arrival until its feedback leaves
// (src/core/peers/peer.cc); what is halfway to "far overdue", and to "a long queue"
// (cc::ShareControl::kTarget).
constexpr double kLeastScale = 0.002;
constexpr double kFeedback = 0.005;
constexpr double kOverdue = 0.05;
constexpr double kLongQueue = 0.03;
// The part of the time in queues by which an expectation is uncertain.
constexpr double kUncertain = 0.25;
// Scales of slack, of loss, of messages ahead and of messages under way.
constexpr double kMuchSlack = 4;
constexpr double kMuchLoss = 0.05;
constexpr double kManyAhead = 4;
constexpr double kManyUnderWay = 16;
constexpr double kLongAir = 1.5;
// A share of less than this part of the rate means that others use the link, too.
constexpr double kAlone = 0.95;

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

// 0 at 0, half at 1, 1 far out.
double saturating(double v) { return v / (1 + std::abs(v)); }

// From 0 at `from` to 1 at `to`.
double ramp(double v, double from, double to) {
  return std::clamp((v - from) / (to - from), 0.0, 1.0);
}

// Which part of the link's rate is not ours.
double of_others(const LinkState& link) {
  if (link.rate <= DataRate{} || link.share <= DataRate{}) return 0;
  return 1 - std::min(1.0, static_cast<double>(link.share.bits_per_second) /
                               static_cast<double>(link.rate.bits_per_second));
}

const OnTimeLaw& law_of(const Outlook& o) {
  if (o.refused) return kRefusedLaw;
  return o.ahead > 0 || of_others(o.link) > 1 - kAlone ? kLoadedLaw : kIdleLaw;
}

// Between the knots in a line, beyond them in parallel to the identity.
double bent(const OnTimeLaw& law, double log_odds) {
  const auto& knots = law.knots;
  const auto above = std::ranges::lower_bound(knots, log_odds, {}, &OnTimeLaw::Knot::said);
  if (above == knots.begin()) return knots.front().seen + log_odds - knots.front().said;
  if (above == knots.end()) return knots.back().seen + log_odds - knots.back().said;
  const auto below = above - 1;
  return below->seen + (above->seen - below->seen) * ramp(log_odds, below->said, above->said);
}

}  // namespace

void Outlook::consider(const LinkState& way, std::optional<Duration> arrival,
                       std::size_t bytes_ahead, std::size_t own_bytes, bool is_refused) {
  const bool sooner = arrival && (!expected || *arrival < *expected);
  if (bytes > 0 && (is_refused == refused ? !sooner : is_refused)) return;
  expected = arrival;
  ahead = bytes_ahead;
  bytes = own_bytes;
  refused = is_refused;
  link = way;
}

double OnTimeForecasts::predict(const Outlook& o) const {
  const auto known = records_.find(o.peer);
  const Record fresh;
  const Record& record = known == records_.end() ? fresh : known->second;
  const LinkState& link = o.link;

  const double deadline = seconds(o.deadline);
  const double expected = o.expected ? seconds(*o.expected) : 0;
  const double one_way = seconds(link.rtt_min) / 2;
  const double slack = deadline - expected;
  const double waits = std::max(0.0, expected - one_way);
  const double scale = seconds(link.jitter) + kUncertain * waits + kLeastScale;
  const double by_record = (slack - record.excess) / (record.spread + kLeastScale);
  const double share = std::clamp(
      (record.on_time + kPriorOnTime * kPriorMessages) / (record.messages + kPriorMessages),
      kLeastShare, 1 - kLeastShare);
  const double odds = std::log(share / (1 - share)) / kMostLogOdds;
  const double air = std::min(kLongAir, std::max(0.0, waits - seconds(link.queue_up)) / deadline);
  const double others = of_others(link);
  double overdue = 0;
  if (!record.due.empty()) {
    overdue = std::max(0.0, seconds(o.at - *record.due.begin()) - one_way - kFeedback);
  }

  const OnTimeFeatures features{
      1,
      saturating(slack / scale / kMuchSlack),
      link.path == PathState::kOk ? 0.0 : 1.0,
      saturating(overdue / kOverdue),
      saturating(seconds(link.rtt_p95 - link.rtt_min) / deadline),
      saturating(link.loss / kMuchLoss),
      std::clamp(slack / deadline, 0.0, 1.0),
      ramp(by_record, -2, 0),
      ramp(by_record, 0, 1),
      ramp(by_record, 1, 3),
      odds,
      std::min(1.0, static_cast<double>(o.ahead) / static_cast<double>(o.bytes + 1) / kManyAhead),
      std::min(1.0, static_cast<double>(record.due.size()) / kManyUnderWay),
      others,
      saturating(seconds(link.queue_up) / kLongQueue),
      air,
      air * odds,
      others * odds};
  const OnTimeLaw& law = law_of(o);
  double log_odds = 0;
  for (std::size_t i = 0; i < features.size(); ++i) log_odds += law.weights[i] * features[i];
  const double shift = o.refused ? 0 : record.shift;
  return 1 / (1 + std::exp(-bent(law, log_odds) - shift));
}

void OnTimeForecasts::sent(SendId id, const Outlook& o, double predicted) {
  const Duration expected = o.expected.value_or(Duration::zero());
  const UnderWay message{o.peer, o.at + expected, o.deadline, expected, predicted};
  if (under_way_.emplace(id, message).second) records_[o.peer].due.insert(message.due);
}

void OnTimeForecasts::settled(const MessageFate& fate) {
  const auto it = under_way_.find(fate.id);
  if (it == under_way_.end()) return;
  const UnderWay message = it->second;
  under_way_.erase(it);
  const auto record = records_.find(message.peer);
  if (record == records_.end()) return;
  std::multiset<TimePoint>& due = record->second.due;
  if (const auto at = due.find(message.due); at != due.end()) due.erase(at);
  learn(record->second, message, fate);
}

void OnTimeForecasts::learn(Record& record, const UnderWay& message, const MessageFate& fate) {
  const auto says_nothing = {FateReason::kCancelled, FateReason::kSuperseded,
                             FateReason::kPeerGone};
  if (std::ranges::find(says_nothing, fate.reason) != says_nothing.end()) return;
  const bool arrived = fate.fate == Fate::kDelivered || fate.fate == Fate::kLate;
  const Duration slack = message.deadline - message.expected;
  const double excess = arrived
                            ? seconds(fate.age - message.expected)
                            : std::max(0.0, seconds(slack)) + kMissedBy * seconds(message.deadline);
  const double bounded = std::clamp(excess, -kMostExcess, kMostExcess);
  record.spread += (std::abs(bounded - record.excess) - record.spread) * kNewest;
  record.excess += (bounded - record.excess) * kNewest;
  const double on_time = fate.fate == Fate::kDelivered ? 1 : 0;
  record.shift =
      std::clamp(record.shift + kShiftBy * (on_time - message.predicted), -kMostShift, kMostShift);
  record.messages = record.messages * kKeep + 1;
  record.on_time = record.on_time * kKeep + on_time;
}

}  // namespace interneuron
