#include "core/messages/on_time_forecast.h"

#include <algorithm>
#include <cmath>

namespace interneuron::messages {
namespace {

// The weights of the law: log-odds for each unit of a factor. Source: a logistic regression over
// seeds 1 and 2 of `interneuron bench forecast`, 0.89 million messages, in which each scenario
// counts by what there is to explain in it (docs/load.md, "Fitting anew"). Refused messages have a
// base and a weight of their own, of seeds 1 to 4: few of them are ever sent nevertheless.
//
// The log-odds of a message of which all factors are 0.
constexpr double kBase = 0.265;
constexpr double kRefusedBase = 5.521;
// For each deadline that is left for the smallest variant.
constexpr double kRoom = 4.176;
// For each spread of the peer's ages that there is to spare.
constexpr double kMargin = 0.145;
// For each deadline that the link needs for what is under way and the message.
constexpr double kPressure = -0.830;
constexpr double kRefusedPressure = -6.277;
// For each log-odds of the record.
constexpr double kRecord = 0.643;
// While nothing is under way and nobody else uses the link; while the link is not known to work;
// where half of the link is others'.
constexpr double kIdle = 2.100;
constexpr double kSuspicion = -2.518;
constexpr double kContention = 0.895;

// Beyond these bounds a factor says no more, in its own unit: judged on the same seeds.
constexpr double kLeastRoom = -0.5;
constexpr double kMostRoom = 0.3;
constexpr double kMostMargin = 5;
constexpr double kMostDeadlines = 2;
// Others use the link where they have more than this part of its rate.
constexpr double kAlone = 0.05;

// How much of the sums stays with the next message, a record of some 33 messages; and the weight of
// the newest in excess and spread. The record begins with one message, this part of it on time, and
// is kept from certainty. No measurement behind these values.
constexpr double kKeep = 0.97;
constexpr double kNewest = 0.08;
constexpr double kPriorOnTime = 0.9;
constexpr double kLeastShare = 0.005;
// Excesses are bounded by this, in seconds: a peer's clock may be far off. A message that was not
// there exceeds its slack by this part of its deadline. In seconds, what no spread falls short of.
constexpr double kMostExcess = 0.5;
constexpr double kMissedBy = 0.2;
constexpr double kLeastSpread = 0.002;
// How far a prediction of 1 that was wrong moves the drift, in log-odds, and the largest drift.
// Larger steps find it sooner and make predictions less steady.
constexpr double kStep = 0.1;
constexpr double kMostDrift = 10;

double log_odds(double messages, double on_time) {
  const double share =
      std::clamp((on_time + kPriorOnTime) / (messages + 1), kLeastShare, 1 - kLeastShare);
  return std::log(share / (1 - share));
}

// Which part of the link's rate is not ours.
double of_others(const Outlook& o) {
  if (o.rate <= DataRate{} || o.share <= DataRate{}) return 0;
  return 1 - std::min(1.0, static_cast<double>(o.share.bits_per_second) /
                               static_cast<double>(o.rate.bits_per_second));
}

}  // namespace

// What the law weighs. A delay or a rate that was not measured says nothing: its factor is 0.
struct OnTimeForecasts::Factors {
  // The part of the deadline that is left when the smallest variant would be there if nothing of
  // our own went before it.
  double room = 0;
  // What is left of the deadline when the message should be there by the peer's record, in spreads
  // of its ages.
  double margin = 0;
  // Deadlines that pass until the message is expected and what is under way could have left.
  double pressure = 0;
  // The log-odds of the share of earlier messages on time.
  double record = 0;
  // 1 or 0: nothing is under way, and nobody else uses the link.
  double idle = 0;
  // 1 or 0: feedback is late, or a long queue has built up.
  double suspicion = 0;
  // From 0 where the link is ours or not at all to 1 where half of it is others': the share that we
  // have settled on leaves room for what comes.
  double contention = 0;
};

OnTimeForecasts::Factors OnTimeForecasts::factors(const Outlook& o, const Record& r) {
  const double deadline = to_seconds(o.deadline);
  const double others = of_others(o);
  const DataRate usable = o.share > DataRate{} ? std::min(o.share, o.rate) : o.rate;
  Factors out;
  if (usable > DataRate{}) {
    const double bytes_per_second = static_cast<double>(usable.bits_per_second) / 8;
    out.pressure = static_cast<double>(r.bytes_under_way) / bytes_per_second / deadline;
  }
  if (o.least) {
    out.room = std::clamp((deadline - to_seconds(*o.least)) / deadline, kLeastRoom, kMostRoom);
  }
  if (o.expected) {
    const double spare = deadline - to_seconds(*o.expected) - r.excess;
    out.margin = std::clamp(spare / (r.spread + kLeastSpread), -kMostMargin, kMostMargin);
    out.pressure += to_seconds(*o.expected) / deadline;
  }
  out.pressure = std::min(out.pressure, kMostDeadlines);
  out.record = log_odds(r.messages, r.on_time);
  out.idle = r.under_way == 0 && others < kAlone ? 1 : 0;
  out.suspicion = o.path == PathState::kOk ? 0 : 1;
  out.contention = 4 * others * (1 - others);
  return out;
}

double OnTimeForecasts::predict(const Outlook& o) const {
  const auto known = records_.find(o.peer);
  const Record record = known == records_.end() ? Record{} : known->second;
  const Factors f = factors(o, record);
  const double says = o.refused
                          ? kRefusedBase + kRefusedPressure * f.pressure
                          : kBase + kRoom * f.room + kMargin * f.margin + kPressure * f.pressure +
                                kRecord * f.record + kIdle * f.idle + kSuspicion * f.suspicion +
                                kContention * f.contention + record.drift;
  return 1 / (1 + std::exp(-says));
}

void OnTimeForecasts::sent(SendId id, const Outlook& o, double predicted) {
  const UnderWay message{o.peer, o.bytes, o.deadline, o.expected.value_or(Duration{}), predicted};
  if (!under_way_.emplace(id, message).second) return;
  Record& record = records_[o.peer];
  record.bytes_under_way += o.bytes;
  ++record.under_way;
}

void OnTimeForecasts::settled(const MessageFate& fate) {
  const auto it = under_way_.find(fate.id);
  if (it == under_way_.end()) return;
  const UnderWay was = it->second;
  under_way_.erase(it);
  const auto known = records_.find(was.peer);
  if (known == records_.end()) return;
  // A peer that was forgotten meanwhile has a new record, which does not count its old messages.
  Record& record = known->second;
  record.bytes_under_way -= std::min(record.bytes_under_way, was.bytes);
  record.under_way -= std::min<std::size_t>(record.under_way, 1);
  const auto says_nothing = {FateReason::kCancelled, FateReason::kSuperseded,
                             FateReason::kPeerGone};
  if (std::ranges::find(says_nothing, fate.reason) == says_nothing.end()) learn(record, was, fate);
}

void OnTimeForecasts::learn(Record& record, const UnderWay& message, const MessageFate& fate) {
  const bool arrived = fate.fate == Fate::kDelivered || fate.fate == Fate::kLate;
  const Duration slack = message.deadline - message.expected;
  const double excess =
      arrived ? to_seconds(fate.age - message.expected)
              : std::max(0.0, to_seconds(slack)) + kMissedBy * to_seconds(message.deadline);
  const double bounded = std::clamp(excess, -kMostExcess, kMostExcess);
  record.spread += (std::abs(bounded - record.excess) - record.spread) * kNewest;
  record.excess += (bounded - record.excess) * kNewest;
  const double on_time = fate.fate == Fate::kDelivered ? 1 : 0;
  record.messages = record.messages * kKeep + 1;
  record.on_time = record.on_time * kKeep + on_time;
  // A step down the slope of the logarithmic loss.
  record.drift =
      std::clamp(record.drift + kStep * (on_time - message.predicted), -kMostDrift, kMostDrift);
}

}  // namespace interneuron::messages
