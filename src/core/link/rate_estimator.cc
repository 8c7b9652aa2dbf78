#include "core/link/rate_estimator.h"

#include <algorithm>

#include "interneuron/sizes.h"

namespace interneuron::link {
namespace {

// Bytes of a train's packet on the wire, to tell a train's length from its rate. On links with a
// smaller MTU trains are shorter than this says.
constexpr std::size_t kPacketBytes = kMaxPacketBytes;

// Trains are within ±15 % of the rate; a larger ratio means that the rate has changed.
constexpr double kDisputed = 1.15;

Duration dispersion(std::uint32_t packets, DataRate measured) {
  return measured.transmit_time((packets - 1) * kPacketBytes);
}

DataRate middle(DataRate a, DataRate b, DataRate c) {
  return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

}  // namespace

void RateEstimator::History::put(const Train& train) {
  if (count > 0 && trains[count - 1].id == train.id) {
    trains[count - 1] = train;
    return;
  }
  if (count == kTrains) {
    std::copy(trains.begin() + 1, trains.end(), trains.begin());
    --count;
  }
  trains[count++] = train;
}

void RateEstimator::History::drop(std::uint64_t id) {
  if (count > 0 && trains[count - 1].id == id) --count;
}

// Of two trains the lower one counts.
DataRate RateEstimator::History::median() const {
  if (count < kTrains) return std::min(trains[0].measured, trains[count - 1].measured);
  return middle(trains[0].measured, trains[1].measured, trains[2].measured);
}

// How far a train is trusted. `shown` is what it shows of the link, which is less than `measured`
// when the train was compressed on its way.
RateEstimator::Grade RateEstimator::grade(std::uint32_t packets, DataRate measured,
                                          DataRate shown) {
  if (dispersion(packets, measured) >= kMinDispersion) return kStrong;
  const bool told = dispersion(packets, shown) >= kLeastDispersion || packets >= kLongTrain;
  return told ? kWeak : kGuess;
}

void RateEstimator::train(TimePoint now, std::uint64_t id, std::uint32_t packets, DataRate measured,
                          std::optional<DataRate> sent_at) {
  if (packets < kMinTrainPackets || measured <= DataRate{}) return;
  const bool grown = newest_ && newest_->id == id;
  if (grown && packets <= newest_->packets) return;
  // A train that arrives faster than it left was compressed on its way: it shows the rate at which
  // it was sent and no more.
  const bool limited = sent_at && measured >= sent_at->scaled(kSenderLimited);
  const Train train{id, packets, limited ? std::min(measured, *sent_at) : measured, limited,
                    sent_at.has_value()};
  newest_ = train;

  const Grade trust = grade(packets, measured, train.measured);
  History& history = histories_[trust];
  if (limited) {
    History others = history;
    others.drop(id);
    // It shows the least that the link carries, which is no news below the estimate.
    if (others.count > 0 && train.measured < others.median()) {
      history = others;
      return;
    }
  }
  history.put(train);
  for (std::size_t better = trust + 1; better < kGrades; ++better) {
    if (histories_[better].count > 0) return;
  }
  if (trust == kGuess) return;
  floor_.reset();
  measured_at_ = now;
}

void RateEstimator::sample(TimePoint now, const DeliveryRate::Sample& sample) {
  std::copy(samples_.begin() + 1, samples_.end(), samples_.begin());
  samples_.back() = sample.rate;
  const DataRate median = middle(samples_[0], samples_[1], samples_[2]);
  const std::optional<DataRate> known = raw(kWeak);
  if (!known || median <= *known) return;
  floor_ = median;
  measured_at_ = now;
}

// Delivery rate samples alone make no estimate: they would pace a link by what the application
// happened to send.
std::optional<DataRate> RateEstimator::raw(Grade least) const {
  for (std::size_t trust = kGrades; trust-- > least;) {
    if (histories_[trust].count == 0) continue;
    const DataRate median = histories_[trust].median();
    return std::max(median, floor_.value_or(median));
  }
  return std::nullopt;
}

bool RateEstimator::disputed() const {
  const History& history = histories_[kStrong];
  if (history.count < kTrains) return false;
  const DataRate median = history.median();
  const auto differs = [median](const Train& train) {
    return train.measured.scaled(kDisputed) < median || median.scaled(kDisputed) < train.measured;
  };
  return differs(history.trains[kTrains - 1]) && !differs(history.trains[kTrains - 2]);
}

std::optional<DataRate> RateEstimator::capped(std::optional<DataRate> rate) const {
  return rate && cap_ ? std::min(*rate, *cap_) : rate;
}

std::optional<DataRate> RateEstimator::rate() const { return capped(raw(kWeak)); }

std::optional<DataRate> RateEstimator::guess() const { return capped(raw(kGuess)); }

std::optional<DataRate> RateEstimator::pace() const {
  const std::optional<DataRate> known = raw(kGuess);
  if (!known) return std::nullopt;
  if (!newest_ || !newest_->paced) return capped(known->scaled(kHeadroom));
  // A faster train that the median does not believe yet needs room to be confirmed.
  const DataRate base = std::max(*known, newest_->measured);
  return capped(base.scaled(newest_->limited_by_us ? kSearchHeadroom : kHeadroom));
}

}  // namespace interneuron::link
