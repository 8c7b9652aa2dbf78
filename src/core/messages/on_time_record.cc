#include "core/messages/on_time_record.h"

#include <algorithm>
#include <cmath>

namespace interneuron {
namespace {

// All values here are scales of what the laws weigh, chosen on the seeds that they were fitted on.
//
// How much of a sum stays with the next message: records of some 6 and 33 messages.
constexpr double kKeepLast = 0.85;
constexpr double kKeepOfLate = 0.97;
// Weights of the newest message in excess and spread, and in the mean gap and size.
constexpr double kNewest = 0.08;
constexpr double kNewestGap = 0.2;
// What a share begins with: a message, and which part of it was on time; the share is kept from
// certainty, and its log-odds are scaled to [-1, 1].
constexpr double kPriorMessages = 1;
constexpr double kPriorOnTime = 0.9;
constexpr double kLeastShare = 0.005;
constexpr double kMostLogOdds = 5.3;
// Excesses are bounded by this, in seconds: a peer's clock may be far off.
constexpr double kMostExcess = 0.5;
// A message that was not there exceeds its slack by this part of its deadline.
constexpr double kMissedBy = 0.2;
// Seconds: of a scale, and of a gap, that may be 0; from an arrival until its feedback leaves
// (src/core/peers/feedback_due.h); what is halfway to "far overdue".
constexpr double kLeastScale = 0.002;
constexpr double kLeastGap = 1e-4;
constexpr double kFeedback = 0.005;
constexpr double kOverdue = 0.05;
// What is halfway: to a lossy link; to jitter of much of the deadline; to slack of many jitters; to
// a long record, in messages. Then what are many messages under way.
constexpr double kMuchLoss = 0.05;
constexpr double kMuchJitter = 0.1;
constexpr double kMuchSlack = 4;
constexpr double kLongRecord = 8;
constexpr double kManyUnderWay = 16;

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

// 0 at 0, half at 1, 1 far out.
double saturating(double v) { return v / (1 + std::abs(v)); }

// From 0 at `from` to 1 at `to`.
double ramp(double v, double from, double to) {
  return std::clamp((v - from) / (to - from), 0.0, 1.0);
}

// Which part of the link's rate is not ours.
double of_others(const Outlook& o) {
  if (o.rate <= DataRate{} || o.share <= DataRate{}) return 0;
  return 1 - std::min(1.0, static_cast<double>(o.share.bits_per_second) /
                               static_cast<double>(o.rate.bits_per_second));
}

double bytes_per_second(const Outlook& o) {
  const DataRate rate = o.share > DataRate{} ? std::min(o.share, o.rate) : o.rate;
  return static_cast<double>(rate.bits_per_second) / 8;
}

}  // namespace

void OnTimeRecord::Share::learn(double was_on_time, double keep) {
  messages = messages * keep + 1;
  on_time = on_time * keep + was_on_time;
}

double OnTimeRecord::Share::log_odds() const {
  const double share =
      std::clamp((on_time + kPriorOnTime * kPriorMessages) / (messages + kPriorMessages),
                 kLeastShare, 1 - kLeastShare);
  return std::log(share / (1 - share)) / kMostLogOdds;
}

// Seconds since feedback on the oldest message under way should have come.
double OnTimeRecord::overdue(const Outlook& o) const {
  if (due_.empty()) return 0;
  return std::max(0.0, seconds(o.at - *due_.begin()) - seconds(o.rtt_min) / 2 - kFeedback);
}

// The rate at which messages were handed over of late, over the rate at which they may leave.
double OnTimeRecord::demand(const Outlook& o) const {
  const double rate = bytes_per_second(o);
  if (last_at_ == TimePoint::min() || rate <= 0) return 0;
  const double gap = gap_ + (seconds(o.at - last_at_) - gap_) * kNewestGap;
  const double size = size_ + (static_cast<double>(o.bytes) - size_) * kNewestGap;
  return size / (rate * std::max(gap, kLeastGap));
}

// The order is that of the weights.
OnTimeFeatures OnTimeRecord::features(const Outlook& o) const {
  const double deadline = seconds(o.deadline);
  const double expected = o.expected ? seconds(*o.expected) : 0;
  const double least = o.least ? seconds(*o.least) : 0;
  // Parts of the deadline: what is left of it when the message is expected, and would be for its
  // smallest variant if nothing went before it; the queue in the network; what is under way.
  const double slack = (deadline - expected) / deadline;
  const double room = (deadline - least) / deadline;
  const double queue = seconds(o.queue) / deadline;
  const double rate = bytes_per_second(o);
  const double drain = rate > 0 ? static_cast<double>(under_way_) / rate / deadline : 0;
  const double jitter = seconds(o.jitter) / deadline;
  const double spread = saturating(seconds(o.rtt_p95 - o.rtt_min) / deadline);
  const double by_record = (deadline - expected - excess_) / (spread_ + kLeastScale);
  const double late = late_.log_odds();
  const double last = last_.log_odds();
  const double others = of_others(o);
  const double load = demand(o);
  return {1,
          ramp(slack, -0.5, 0),
          ramp(slack, 0, 0.1),
          ramp(slack, 0.1, 0.3),
          ramp(slack, 0.3, 0.8),
          ramp(room, -0.5, 0),
          ramp(room, 0, 0.1),
          ramp(room, 0.1, 0.3),
          ramp(room, 0.3, 0.6),
          ramp(room, 0.6, 0.9),
          saturating((deadline - least) / (seconds(o.jitter) + kLeastScale) / kMuchSlack),
          o.path == PathState::kOk ? 0.0 : 1.0,
          saturating(overdue(o) / kOverdue),
          spread,
          saturating(jitter / kMuchJitter),
          ramp(queue, 0, 0.2),
          ramp(queue, 0.2, 0.6),
          saturating(o.loss / kMuchLoss),
          ramp(o.loss, 0, 0.005),
          ramp(jitter, 0, 0.02),
          ramp(by_record, -2, 0),
          ramp(by_record, 0, 1),
          ramp(by_record, 1, 3),
          late,
          last,
          1 / (1 + late_.messages / kLongRecord),
          others,
          ramp(others, 0.3, 0.9),
          others * late,
          others * last,
          std::min(1.0, static_cast<double>(due_.size()) / kManyUnderWay),
          ramp(drain, 0, 0.3),
          ramp(drain, 0.3, 1),
          ramp(drain, 1, 2),
          ramp(load, 0.3, 0.8),
          ramp(load, 0.8, 1.1),
          ramp(load, 1.1, 2),
          ramp(load, 0.8, 1.1) * late,
          spread * late};
}

void OnTimeRecord::sent(const Outlook& o, const Message& message) {
  if (last_at_ != TimePoint::min()) {
    const double gap = seconds(o.at - last_at_);
    gap_ = gap_ > 0 ? gap_ + (gap - gap_) * kNewestGap : gap;
  }
  const auto size = static_cast<double>(o.bytes);
  size_ = size_ > 0 ? size_ + (size - size_) * kNewestGap : size;
  last_at_ = o.at;
  due_.insert(message.due);
  under_way_ += message.bytes;
}

void OnTimeRecord::ended(const Message& message) {
  if (const auto at = due_.find(message.due); at != due_.end()) due_.erase(at);
  under_way_ -= std::min(under_way_, message.bytes);
}

void OnTimeRecord::learn(const Message& message, const MessageFate& fate) {
  const bool arrived = fate.fate == Fate::kDelivered || fate.fate == Fate::kLate;
  const Duration slack = message.deadline - message.expected;
  const double excess = arrived
                            ? seconds(fate.age - message.expected)
                            : std::max(0.0, seconds(slack)) + kMissedBy * seconds(message.deadline);
  const double bounded = std::clamp(excess, -kMostExcess, kMostExcess);
  spread_ += (std::abs(bounded - excess_) - spread_) * kNewest;
  excess_ += (bounded - excess_) * kNewest;
  const double on_time = fate.fate == Fate::kDelivered ? 1 : 0;
  last_.learn(on_time, kKeepLast);
  late_.learn(on_time, kKeepOfLate);
  bias_.learn(message.raw, message.predicted, on_time);
}

}  // namespace interneuron
