#include "core/link/rate_estimator.h"

#include <algorithm>

namespace interneuron::link {
namespace {

// Trains are within ±15 % of the rate; a larger ratio means that the rate has changed.
constexpr double kDisputed = 1.15;

// The share of the packets after the first that arrived.
double share_arrived(const Train& train) {
  return static_cast<double>(train.packets - 1) / (std::max(train.left, train.packets) - 1);
}

// How long the train took to arrive.
Duration dispersion(const Train& train) {
  const double bytes = share_arrived(train) * static_cast<double>(train.bytes);
  return train.measured.transmit_time(static_cast<std::size_t>(bytes));
}

DataRate middle(DataRate a, DataRate b, DataRate c) {
  return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

}  // namespace

void RateEstimator::History::put(const Seen& train) {
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

// Where there are two trains, the lower one counts.
DataRate RateEstimator::History::median() const {
  if (count < kTrains) return std::min(trains[0].shown, trains[count - 1].shown);
  return middle(trains[0].shown, trains[1].shown, trains[2].shown);
}

// How far a train is trusted. `shown` is what it shows of the link, which is less than what was
// measured when the train was compressed on its way.
std::optional<RateEstimator::Grade> RateEstimator::grade(const Train& train, DataRate shown) {
  const Duration few = kMinPacketTime / train.packets;
  if (dispersion(train) >= std::max<Duration>(kMinDispersion, few)) return kStrong;
  if (train.packets < kMinTrainPackets) return std::nullopt;
  const bool told =
      shown.transmit_time(train.bytes) >= kLeastDispersion || train.packets >= kLongTrain;
  return told ? kWeak : kGuess;
}

// Whether we paused within the train for longer than half the time that its packets are apart, so
// that the link may have been idle.
bool RateEstimator::paused(const Train& train) {
  const Duration apart = dispersion(train) / (std::max(train.left, 2U) - 1);
  return train.pause > std::max<Duration>(kLeastDispersion, apart / 2);
}

// Packets of a full queue are lost because the link is slow, and others by chance: where we paused
// there was no queue to be full, so that the rate of those that arrived is compared.
bool RateEstimator::limited_by_us(const Train& train) {
  if (!train.sent_at) return false;
  if (!paused(train)) return train.measured >= train.sent_at->scaled(kSenderLimited);
  return train.measured >= train.sent_at->scaled(kPausedLimited * share_arrived(train));
}

void RateEstimator::note_guess(TimePoint now) {
  const std::optional<DataRate> known = raw(kGuess);
  if (!known) return;
  guesses_.add(now, -known->bits_per_second);
  guessed_at_ = now;
}

std::optional<DataRate> RateEstimator::best() const {
  const std::optional<std::int64_t> least = guesses_.get(guessed_at_);
  return capped(least ? std::optional(DataRate{-*least}) : std::nullopt);
}

void RateEstimator::train(TimePoint now, const Train& told) {
  if (told.packets < 2 || told.measured <= DataRate{}) return;
  const bool grown = newest_ && newest_->id == told.id;
  if (grown && told.packets <= newest_->packets) return;
  // A train that arrives faster than it left was compressed on its way: it shows the rate at which
  // it was sent and no more.
  const bool limited = limited_by_us(told);
  const DataRate shown = limited ? std::min(told.measured, *told.sent_at) : told.measured;
  const std::optional<Grade> grade_or_none = grade(told, shown);
  if (!grade_or_none) return;
  // With pauses of ours in it, that is what the application happened to send.
  const std::optional<DataRate> known = raw(kGuess);
  if (limited && paused(told) && (!known || shown <= *known)) return;
  const Grade trust = *grade_or_none;
  const Seen train{told.id, told.packets, shown, limited, told.sent_at.has_value()};
  newest_ = train;

  History& history = histories_[trust];
  if (limited) {
    History others = history;
    others.drop(train.id);
    // It shows the least that the link carries, which is no news below the estimate.
    if (others.count > 0 && train.shown < others.median()) {
      history = others;
      return;
    }
  }
  history.put(train);
  note_guess(now);
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
  note_guess(now);
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
  const auto differs = [median](const Seen& train) {
    return train.shown.scaled(kDisputed) < median || median.scaled(kDisputed) < train.shown;
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
  const DataRate base = std::max(*known, newest_->shown);
  return capped(base.scaled(newest_->limited_by_us ? kSearchHeadroom : kHeadroom));
}

}  // namespace interneuron::link
