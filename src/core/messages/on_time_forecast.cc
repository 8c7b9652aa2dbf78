#include "core/messages/on_time_forecast.h"

#include <algorithm>
#include <cmath>

namespace interneuron::messages {
namespace {

// The weights of the law: log-odds for each unit of a factor. Source: a logistic regression over
// seeds 1 and 2 of `interneuron bench forecast`, 0.77 million messages, in which each scenario
// counts by what there is to explain in it (docs/load.md, "Fitting anew"). Refused messages have a
// base and weights of their own, of seeds 1 to 4: few of them are ever sent nevertheless.
//
// The log-odds of a message of which all factors are 0.
constexpr double kBase = 2.142;
constexpr double kRefusedBase = 0.274;
// For each deadline that is left for the smallest variant.
constexpr double kRoom = 4.612;
constexpr double kRefusedRoom = 4.465;
// For each spread of the peer's ages that there is to spare.
constexpr double kMargin = 0.397;
// How far the margin is on the way from 1 spread to 3, and how small the message is.
constexpr double kRefusedCertainty = 3.124;
constexpr double kRefusedSmallness = 10.117;
// For each deadline that the link needs for what is under way and the message.
constexpr double kPressure = -1.759;
constexpr double kRefusedPressure = -1.497;
// For each log-odds of the record, and each deadline that the link needs for what is under way.
constexpr double kRecord = 0.569;
// For each log-odds of the record, anywhere and where as much is accepted as may leave.
constexpr double kRefusedRecord = 0.295;
constexpr double kRefusedOverload = -0.681;
// While nothing is under way and nobody else uses the link; while the link is not known to work;
// where half of the link is others'.
constexpr double kIdle = 2.737;
constexpr double kSuspicion = -5.318;
constexpr double kContention = 1.101;

// Beyond these bounds a factor says no more, in its own unit: judged on the same seeds.
constexpr double kLeastRoom = -0.5;
constexpr double kMostRoom = 0.3;
constexpr double kMostRefusedRoom = 1;
constexpr double kMostMargin = 5;
constexpr double kMostDeadlines = 2;
// A refused message's certainty grows from 0 to 1 between these margins, in spreads.
constexpr double kUncertain = 1;
constexpr double kCertain = 3;
// Its overload grows from none to all between these parts of the rate that may leave.
constexpr double kFits = 0.8;
constexpr double kOverloaded = 1.1;
// The size in bytes at which its smallness is a half, about one packet.
constexpr double kPacketBytes = 1200;
// Others use the link where they have more than this part of its rate.
constexpr double kAlone = 0.05;

// How much of the sums stays with the next message, a record of some 33 messages; and the weight of
// the newest in excess and spread. The record begins with one message, this part of it on time, and
// is kept from certainty. No measurement behind these values.
constexpr double kKeep = 0.97;
constexpr double kNewest = 0.08;
constexpr double kNewestGap = 0.2;
constexpr double kPriorOnTime = 0.9;
constexpr double kLeastShare = 0.005;
// Excesses are bounded by this, in seconds: a peer's clock may be far off. A message that was not
// there exceeds its slack by this part of its deadline. In seconds, what no spread falls short of.
constexpr double kMostExcess = 0.5;
constexpr double kMissedBy = 0.2;
constexpr double kLeastSpread = 0.002;
// In seconds, what no gap between messages falls short of.
constexpr double kLeastGap = 1e-4;
// How far a prediction of 1 that was wrong moves the drift, in log-odds, and the largest drift.
// Larger steps find it sooner and make predictions less steady.
constexpr double kStep = 0.1;
constexpr double kMostDrift = 10;

// From 0 at `from` to 1 at `to`.
double ramp(double v, double from, double to) {
  return std::clamp((v - from) / (to - from), 0.0, 1.0);
}

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
  // The log-odds of the share of earlier messages on time, by the deadlines that what is under way
  // takes: the busier we are, the more the next one does as the last ones did.
  double record = 0;
  // 1 or 0: nothing is under way, and nobody else uses the link.
  double idle = 0;
  // 1 or 0: feedback is late, or a long queue has built up.
  double suspicion = 0;
  // From 0 where the link is ours or not at all to 1 where half of it is others': the share that we
  // have settled on leaves room for what comes.
  double contention = 0;
  // The log-odds of the record once more, where messages are accepted as fast as they may leave:
  // from 0 at 0.8 of that rate to all of it at 1.1.
  double overload = 0;
  // From 0 to 1: which part of one packet the message would be, where there is room for it. Small
  // ones slip through a queue; over a link that is too long none does.
  double smallness = 0;
};

OnTimeForecasts::Factors OnTimeForecasts::factors(const Outlook& o, const Record& r) {
  const double deadline = to_seconds(o.deadline);
  const double others = of_others(o);
  const DataRate usable = o.share > DataRate{} ? std::min(o.share, o.rate) : o.rate;
  Factors out;
  double drain = 0;
  if (usable > DataRate{}) {
    const double bytes_per_second = static_cast<double>(usable.bits_per_second) / 8;
    drain = static_cast<double>(r.bytes_under_way) / bytes_per_second / deadline;
    out.overload = log_odds(r.messages, r.on_time) *
                   ramp(r.handed_over(o) / bytes_per_second, kFits, kOverloaded);
  }
  if (o.least) {
    const double room = (deadline - to_seconds(*o.least)) / deadline;
    out.room = o.refused ? std::clamp(room, -kMostRefusedRoom, kMostRefusedRoom)
                         : std::clamp(room, kLeastRoom, kMostRoom);
    out.smallness =
        ramp(room, 0, kMostRoom) * kPacketBytes / (kPacketBytes + static_cast<double>(o.bytes));
  }
  out.pressure = drain;
  if (o.expected) {
    const double spare = deadline - to_seconds(*o.expected) - r.excess;
    out.margin = std::clamp(spare / (r.spread + kLeastSpread), -kMostMargin, kMostMargin);
    out.pressure += to_seconds(*o.expected) / deadline;
  }
  out.pressure = std::min(out.pressure, kMostDeadlines);
  out.record = log_odds(r.messages, r.on_time) * std::min(drain, kMostDeadlines);
  out.idle = r.under_way == 0 && others < kAlone ? 1 : 0;
  out.suspicion = o.path == PathState::kOk ? 0 : 1;
  out.contention = 4 * others * (1 - others);
  return out;
}

// Bytes a second of the messages that were accepted and this one; 0 before any was accepted.
double OnTimeForecasts::Record::handed_over(const Outlook& o) const {
  if (!sent_at) return 0;
  const double newest = to_seconds(o.at - *sent_at);
  // The second message has the only gap that there is yet.
  const double mean_gap = gap > 0 ? gap + (newest - gap) * kNewestGap : newest;
  const double mean_size = size + (static_cast<double>(o.bytes) - size) * kNewestGap;
  return mean_size / std::max(mean_gap, kLeastGap);
}

double OnTimeForecasts::predict(const Outlook& o) const {
  const auto known = records_.find(o.peer);
  const Record record = known == records_.end() ? Record{} : known->second;
  const Factors f = factors(o, record);
  const double says = o.refused
                          ? kRefusedBase + kRefusedRoom * f.room +
                                kRefusedCertainty * ramp(f.margin, kUncertain, kCertain) +
                                kRefusedPressure * f.pressure + kRefusedOverload * f.overload +
                                kRefusedRecord * log_odds(record.messages, record.on_time) +
                                kRefusedSmallness * f.smallness
                          : kBase + kRoom * f.room + kMargin * f.margin + kPressure * f.pressure +
                                kRecord * f.record + kIdle * f.idle + kSuspicion * f.suspicion +
                                kContention * f.contention + record.drift;
  return 1 / (1 + std::exp(-says));
}

void OnTimeForecasts::sent(SendId id, const Outlook& o, double predicted) {
  const UnderWay message{o.peer, o.bytes, o.deadline, o.expected.value_or(Duration{}), predicted};
  if (!under_way_.emplace(id, message).second) return;
  Record& record = records_[o.peer];
  if (record.sent_at) {
    const double gap = to_seconds(o.at - *record.sent_at);
    record.gap = record.gap > 0 ? record.gap + (gap - record.gap) * kNewestGap : gap;
  }
  const auto size = static_cast<double>(o.bytes);
  record.size = record.size > 0 ? record.size + (size - record.size) * kNewestGap : size;
  record.sent_at = o.at;
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
