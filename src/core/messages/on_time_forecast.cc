#include "core/messages/on_time_forecast.h"

#include <algorithm>
#include <cmath>

namespace interneuron {
namespace {

// Our share being less than this part of the link's rate means that others use the link, too.
constexpr double kAlone = 0.95;
// What a law may say: beyond, a double is hardly off 1, and nothing is as sure.
constexpr double kMostLogOdds = 14;

// Between the knots in a line, beyond them in parallel to the identity.
double bent(const OnTimeLaw& law, double log_odds) {
  const auto& knots = law.knots;
  const auto above = std::ranges::lower_bound(knots, log_odds, {}, &OnTimeLaw::Knot::said);
  if (above == knots.begin()) return knots.front().seen + log_odds - knots.front().said;
  if (above == knots.end()) return knots.back().seen + log_odds - knots.back().said;
  const auto below = above - 1;
  const double part = (log_odds - below->said) / (above->said - below->said);
  return below->seen + (above->seen - below->seen) * part;
}

}  // namespace

const OnTimeRecord& OnTimeForecasts::record(PeerId peer) const {
  const auto known = records_.find(peer);
  return known == records_.end() ? fresh_ : known->second;
}

OnTimeFeatures OnTimeForecasts::features(const Outlook& o) const {
  return record(o.peer).features(o);
}

OnTimeCase OnTimeForecasts::case_of(const Outlook& o) const {
  if (o.refused) return OnTimeCase::kRefused;
  const bool alone = static_cast<double>(o.share.bits_per_second) >
                     kAlone * static_cast<double>(o.rate.bits_per_second);
  const bool idle = (alone || o.share <= DataRate{}) && record(o.peer).idle();
  return idle ? OnTimeCase::kIdle : OnTimeCase::kLoaded;
}

double OnTimeForecasts::log_odds(const Outlook& o) const {
  const OnTimeCase which = case_of(o);
  const OnTimeLaw& law = which == OnTimeCase::kRefused  ? laws_.refused
                         : which == OnTimeCase::kLoaded ? laws_.loaded
                                                        : laws_.idle;
  const OnTimeFeatures features = record(o.peer).features(o);
  double sum = 0;
  for (std::size_t i = 0; i < features.size(); ++i) sum += law.weights[i] * features[i];
  return std::clamp(bent(law, sum), -kMostLogOdds, kMostLogOdds);
}

OnTimePrediction OnTimeForecasts::predict(const Outlook& o) const {
  const double raw = log_odds(o);
  const double shift = o.refused ? 0 : record(o.peer).correction(raw);
  return {.probability = 1 / (1 + std::exp(-raw - shift)), .unbiased = raw};
}

void OnTimeForecasts::sent(SendId id, const Outlook& o, const OnTimePrediction& predicted) {
  const Duration expected = o.expected.value_or(Duration::zero());
  const OnTimeRecord::Message message{.due = o.at + expected,
                                      .deadline = o.deadline,
                                      .expected = expected,
                                      .bytes = o.bytes,
                                      .raw = predicted.unbiased,
                                      .predicted = predicted.probability};
  if (under_way_.emplace(id, UnderWay{o.peer, message}).second) records_[o.peer].sent(o, message);
}

void OnTimeForecasts::settled(const MessageFate& fate) {
  const auto it = under_way_.find(fate.id);
  if (it == under_way_.end()) return;
  const UnderWay was = it->second;
  under_way_.erase(it);
  const auto record = records_.find(was.peer);
  if (record == records_.end()) return;
  record->second.ended(was.message);
  const auto says_nothing = {FateReason::kCancelled, FateReason::kSuperseded,
                             FateReason::kPeerGone};
  if (std::ranges::find(says_nothing, fate.reason) == says_nothing.end()) {
    record->second.learn(was.message, fate);
  }
}

}  // namespace interneuron
