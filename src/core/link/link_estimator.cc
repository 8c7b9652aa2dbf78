#include "core/link/link_estimator.h"

#include <algorithm>

#include "core/link/nature.h"

namespace interneuron::link {
namespace {

// How late feedback may be by itself: the receiver delays it by up to 5 ms
// (src/core/peers/feedback_due.h), and either event loop adds a turn.
constexpr Duration kFeedbackSlack = std::chrono::milliseconds(10);
// The timeout before the first round trip. No measurement behind this value: it only has to be
// larger than a radio's round trip without a queue.
constexpr Duration kUnknownTimeout = std::chrono::milliseconds(200);
// The shortest timeout. No measurement behind this value: it only has to be larger than
// kFeedbackSlack and a stall of the event loop, or every stall looks like a loss.
constexpr Duration kMinTimeout = std::chrono::milliseconds(20);
// The timeout exceeds the p95 of the round trip by this share of it, as a divisor: 5 % of all round
// trips are longer, and most of them not by much. No measurement behind this value.
constexpr int kTimeoutMarginDivisor = 4;

}  // namespace

void LinkEstimator::set_traits(const LinkTraits& traits) {
  traits_ = traits;
  rate_.set_cap(cap());
}

std::optional<DataRate> LinkEstimator::cap() const {
  const std::optional<DataRate> policed = policed_.cap();
  if (!policed || !traits_.rate_cap) return policed ? policed : traits_.rate_cap;
  return std::min(*policed, *traits_.rate_cap);
}

void LinkEstimator::passed(TimePoint now, std::span<const Passage> packets) {
  policed_.passed(now, packets, queue_up_.queue(now));
  rate_.set_cap(cap());
}

void LinkEstimator::set_heartbeat(TimePoint now, Duration heartbeat) {
  heartbeat_ = heartbeat;
  refresh_pace(now);
}

void LinkEstimator::set_feedback_spacing(TimePoint now, Duration spacing) {
  if (spacing == feedback_spacing_) return;
  feedback_spacing_ = spacing;
  refresh_pace(now);
}

void LinkEstimator::heard(TimePoint now) {
  heard_at_ = now;
  machine_.heard(now);
}

void LinkEstimator::round_trip(TimePoint now, Duration rtt) {
  rtt_.add(now, rtt);
  refresh_pace(now);
}

void LinkEstimator::one_way_delays(TimePoint now, Duration up, Duration down) {
  queue_up_.add(now, up);
  queue_down_.add(now, down);
  refresh_pace(now);
}

void LinkEstimator::clock_stepped() {
  queue_up_.reset();
  queue_down_.reset();
}

void LinkEstimator::delivered(TimePoint now, TimePoint sent_at, bool data) {
  machine_.delivered(now, sent_at, data);
}

void LinkEstimator::delivery_sample(TimePoint now, const DeliveryRate::Sample& sample) {
  rate_.sample(now, sample);
}

void LinkEstimator::peer_sees(DataRate rate_down, double loss_down) {
  rate_down_ = rate_down;
  loss_down_ = loss_down;
}

DataRate LinkEstimator::slower_rate() const {
  const DataRate up = rate().value_or(DataRate{});
  if (up <= DataRate{} || rate_down_ <= DataRate{}) return std::max(up, rate_down_);
  return std::min(up, rate_down_);
}

void LinkEstimator::handle_timeout(TimePoint now) {
  refresh_pace(now);
  machine_.handle_timeout(now);
}

void LinkEstimator::refresh_pace(TimePoint now) {
  machine_.set_pace(
      now, {rtt_.smoothed(), rtt_.variation(), std::max(queue_up_.left(now), queue_down_.left(now)),
            heartbeat_, feedback_spacing_});
}

ProbeSchedule::RateEvidence LinkEstimator::rate_evidence() const {
  // When the newest train disputes the median, only one of them counts, so that the next trains
  // follow as quickly as on a new path. A train that a policer caps would show that cap, and take
  // what messages need; what is sent shows it anyhow.
  std::optional<TimePoint> at = rate_.measured_at();
  if (at && policed_.cap()) at = std::max(*at, policed_.judged_at());
  return {rate_.guess(), at, rate_.disputed() ? 1 : rate_.trains()};
}

Duration LinkEstimator::probe_timeout(TimePoint now) const {
  if (!rtt_.measured()) return kUnknownTimeout;
  const Duration p95 = rtt_.quantile(now, 0.95);
  return std::max(kMinTimeout, p95 + p95 / kTimeoutMarginDivisor + kFeedbackSlack) +
         feedback_spacing_;
}

LinkState LinkEstimator::state(TimePoint now) const {
  LinkState s;
  s.up = up();
  s.path = machine_.state();
  s.traits = traits_;
  s.rtt_p50 = rtt_.quantile(now, 0.5);
  s.rtt_p95 = rtt_.quantile(now, 0.95);
  s.rtt_min = rtt_.minimum(now);
  s.jitter = rtt_.variation();
  s.queue_up = queue_up_.queue(now);
  s.queue_down = queue_down_.queue(now);
  s.rate = rate_.rate().value_or(DataRate{});
  s.rate_down = rate_down_;
  s.loss = loss_.loss();
  s.loss_down = loss_down_;
  s.loss_burst = loss_.burst();
  s.outage = machine_.outage(now);
  s.age = heard_at_ ? now - *heard_at_ : Duration::max();
  s.rate_age = rate_.measured_at() ? now - *rate_.measured_at() : Duration::max();
  s.rtt_samples = static_cast<std::uint32_t>(rtt_.samples(now));
  s.loss_packets = static_cast<std::uint32_t>(loss_.packets());
  s.rate_trains = static_cast<std::uint32_t>(rate_.trains());
  s.confidence = confidence(s.age, kGrace, kHalfLife);
  return s;
}

}  // namespace interneuron::link
