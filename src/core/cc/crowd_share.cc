#include "core/cc/crowd_share.h"

#include <cmath>

#include "core/base/split_mix.h"
#include "interneuron/sizes.h"

namespace interneuron::cc {
namespace {

// What is left of the rate that was used when others are found: what a crowd needs that asks for
// half as much again as its cell. With less, one that asks for a tenth more takes seconds to come
// back.
constexpr double kLeft = 0.7;
// Where others are not seen again so long after they were found, they were never there, or they
// give way as well. If they may be there still, the rate comes back by this factor at each decision
// until they are seen. With 1.15 a crowd that gave way together comes back too fast to notice.
constexpr Duration kProbation = std::chrono::milliseconds(600);
constexpr double kBack = 1.1;
// Where the queue is never shorter than kFull for so long although we give way, others give way to
// nobody: a crowd's is shorter. A crowd of fifty that asks for twice its cell is below it after a
// second. And where what is left of what we ask for is less than a part of so many, this is no way
// to share: what ShareControl does without it is left for a while.
constexpr Duration kStubborn = std::chrono::seconds(2);
constexpr double kFewShares = 6;
constexpr Duration kIgnored = std::chrono::seconds(60);
// Others give way to nobody for so long after that was last certain, and are known for it for a
// while longer. No measurement behind these values.
constexpr Duration kCompetes = std::chrono::seconds(60);
constexpr Duration kRemembered = std::chrono::seconds(5);
// Who uses the first of these shares of the pipe is alone there, and whoever uses less than the
// second is not why the pipe is full. No measurement behind these values.
constexpr double kAllOfIt = 0.9;
constexpr double kHalf = 0.5;
// What competes begins with twice of what it asks for, as CompetingRate allows at most.
constexpr double kAmple = 2;
// Where others have not been seen for so long, they are gone. A crowd is left later, for ten
// vehicles show each other less than fifty do: with 2 s the shares of ten differ by Jain's index of
// .87, with 4 s by .98.
constexpr Duration kGone = std::chrono::seconds(2);
constexpr Duration kCrowdGone = std::chrono::seconds(4);
// While a path is new such a queue, in seconds, convicts without a train: radio seldom delays by as
// much.
constexpr double kNoRadio = 0.08;
// A train that was stretched so long ago still convicts: ten frames of a camera.
constexpr Duration kStretchMemory = std::chrono::seconds(1);
// Messages of so few packets crowd nobody out: the results of an offloaded computation.
constexpr double kSmallMessage = 4 * static_cast<double>(kMaxPacketBytes);

// The mean queue that is aimed at, at a rate of kAtRate; at a quarter of that rate it is twice
// as long. In seconds, with bounds. With 20 vehicles in a cell of 60 Mbit/s it is 18 ms.
constexpr double kMeanQueue = 0.004;
constexpr double kAtRate = 60e6;
constexpr double kLeastMeanQueue = 0.005;
constexpr double kMostMeanQueue = 0.04;
// Decisions are as far apart as the frames of a camera at least; falls are further apart, since it
// takes a frame until one shows.
constexpr Duration kPeriod = std::chrono::milliseconds(100);
constexpr Duration kBetweenFalls = std::chrono::milliseconds(300);
// The rate falls by this share of it where the queue is twice the target, as GCC's and SCReAM's do
// at most.
constexpr double kFall = 0.25;
// And rises by this share of it at each decision without a queue, somewhat faster where it is far
// below what the queue allows. With twice of it the queue goes up and down.
constexpr double kRise = 0.015;
constexpr double kQuick = 1.5;
constexpr double kLeastMean = 0.01;
// A queue that becomes shorter by a tenth between two decisions drains already.
constexpr double kDrains = 0.9;
// Above this queue, in terms of the target, not even the smallest variants have a right.
constexpr double kFarAbove = 2;

// Messages whose period is below this part of their time are under way together. Each leaves at the
// share then: a rate that changes with every message keeps no promise to those before it. A frame
// and the parts of it that are asked for later are no such messages.
constexpr double kOverlaps = 0.25;
// What may be saved up, and owed, in terms of the newest message.
constexpr double kMostSaved = 1.5;
constexpr double kMostOwed = 1;
constexpr double kOwesTooMuch = 0.9;
// How much must be saved up for a message varies by this, in terms of its size, around one.
constexpr double kVariation = 0.5;
// Nothing is sent at more than the share while packets wait for so long, in seconds: a third of a
// deadline of 150 ms.
constexpr double kFull = 0.05;
// A message leaves within this part of its time; and within kLeastPart where queues leave no more.
constexpr int kPart = 3;
constexpr int kLeastPart = 8;
// What brings the smallest variant in time must not bring the best one.
constexpr double kNotTheBest = 0.8;
// The share of the smallest variants, with what repairs and headers take.
constexpr double kWithRepairs = 1.15;
// A share that is this much above what is asked for limits nothing.
constexpr double kEnough = 1.2;
// Memory of what is used, in seconds: five frames of a camera.
constexpr double kUsedMemory = 0.5;
// What the period between two messages may be, in seconds, and the part of a new one that counts.
constexpr double kShortestPeriod = 0.01;
constexpr double kLongestPeriod = 1;
constexpr double kNewPeriod = 0.25;
// A full packet every 100 ms.
constexpr DataRate kOnePacket{8 * 10 * static_cast<std::int64_t>(kMaxPacketBytes)};

double bytes_per_second(DataRate rate) { return static_cast<double>(rate.bits_per_second) / 8; }

DataRate rate_of_bytes(double bytes_per_second) {
  return DataRate{static_cast<std::int64_t>(8 * bytes_per_second)};
}

Duration duration_of(double seconds) { return Duration{static_cast<std::int64_t>(1e9 * seconds)}; }

}  // namespace

double CrowdShare::saved(TimePoint now) const {
  const double most = kMostSaved * std::max(asked_, 2.0 * static_cast<double>(kMaxPacketBytes));
  return std::min(most, saved_ + to_seconds(now - saved_at_) * bytes_per_second(*rate_));
}

double CrowdShare::used(TimePoint now) const {
  return used_at_ ? used_ * std::exp(-to_seconds(now - *used_at_) / kUsedMemory) : 0;
}

void CrowdShare::sent(TimePoint now, std::size_t ip_bytes) {
  queue_.sent(now, ip_bytes);
  newcomer_.sent(now);
  const double bytes = static_cast<double>(ip_bytes);
  used_ = used(now) + bytes / kUsedMemory;
  used_at_ = now;
  if (!rate_) return;
  saved_ = std::max(saved(now) - bytes, -kMostOwed * asked_);
  saved_at_ = now;
}

void CrowdShare::vary() {
  threshold_ = 1 + kVariation * (part_of_one(next_split_mix(random_)) - 0.5);
}

// Frames of a camera have about as long as there is between two of them: so the first one is taken.
void CrowdShare::note_period(TimePoint now, Duration left) {
  const double since =
      std::clamp(to_seconds(asked_at_ ? now - *asked_at_ : left), kShortestPeriod, kLongestPeriod);
  period_ += (asked_at_ ? kNewPeriod : 1) * (since - period_);
  asked_at_ = now;
}

// Copa finds those who give way to nobody in the same way: by a queue that is never nearly empty.
void CrowdShare::met(TimePoint now, TimePoint left_at, Duration waited) {
  queue_.met(now, left_at, waited, capacity_);
  if (!is_crowded()) return;
  const double seconds = to_seconds(waited);
  if (competes_ ? seconds > kLeastMean : seconds <= kFull) queue_told_at_ = now;
}

void CrowdShare::asked(TimePoint now, std::size_t best, std::size_t smallest, Duration left,
                       Duration least_round_trip) {
  if (static_cast<double>(best) <= kSmallMessage) return;
  note_period(now, left);
  newcomer_.asked(now, queue_.others_were_met(), part_of_one(next_split_mix(random_)),
                  least_round_trip);
  asked_ = static_cast<double>(best);
  const Duration own = (left - duration_of(queue_.newest())) / kPart;
  const Duration part = std::max<Duration>({own, left / kLeastPart, Duration{1}});
  best_ = rate_of(best, part);
  smallest_ = floor_ = DataRate{};
  if (smallest < best) {
    smallest_ = std::min(rate_of(smallest, part), rate_of(best, left).scaled(kNotTheBest));
    floor_ = rate_of_bytes(kWithRepairs * static_cast<double>(smallest) / period_);
  }
  if (!rate_) {
    granted_ = !(newcomer_.is_new(now) && (newcomer_.is_held_low() || suspects_others(now)));
    return;
  }
  const bool overlaps = period_ < kOverlaps * to_seconds(left);
  const bool has_saved = saved(now) >= asked_ * threshold_;
  granted_ = has_saved && !overlaps && (competes_ || queue_.newest() < kFull);
  if (granted_) vary();
  if (saved(now) <= -kOwesTooMuch * asked_) smallest_ = DataRate{};
}

// A queue is there that is not ours, and something says that it is one of others' and no radio's.
bool CrowdShare::suspects_others(TimePoint now) const {
  return queue_.others_are_suspected() && (newcomer_.begins_low() || is_stretched(now));
}

bool CrowdShare::is_stretched(TimePoint now) const {
  return stretched_at_ && now - *stretched_at_ < kStretchMemory;
}

DataRate CrowdShare::least() const { return std::min(std::max(kOnePacket, floor_), capacity_); }

// The message that is under way keeps what it was granted.
void CrowdShare::enter(TimePoint now) {
  rate_ = std::clamp(rate_of_bytes(kLeft * used(now)), least(), capacity_);
  saved_at_ = now;
  newcomer_.end();
  vary();
  saved_ = (threshold_ - 1) / kVariation * asked_;
  queue_.begin_again(now);
  entered_at_ = queue_told_at_ = shared_at_ = now;
  before_ = 0;
  longest_ = queue_.newest();
  decide_at_ = now + kPeriod;
  fall_at_ = now + kBetweenFalls;
  competes_ = false;
  if (now < competes_until_ + kRemembered) compete(now);
}

// What is asked for in the mean, as far as the pipe carries it.
DataRate CrowdShare::wanted() const { return std::min(capacity_, rate_of_bytes(asked_ / period_)); }

// Others give way to nobody, as CUBIC does: who gives way to them is left nothing. Trains among
// theirs have told less and less of the pipe by then.
void CrowdShare::compete(TimePoint now) {
  competes_ = true;
  queue_told_at_ = now;
  capacity_ = std::max(capacity_, before_others_);
  competing_.begin(now, std::min(wanted().scaled(kAmple), capacity_.scaled(kHalf)));
  competes_until_ = now + kCompetes;
}

void CrowdShare::answer_stubborn(TimePoint now) {
  const bool has_share = rate_->scaled(kFewShares) >= wanted();
  if (has_share) shared_at_ = now;
  if (now - queue_told_at_ > kStubborn) {
    compete(now);
  } else if (now - shared_at_ > kStubborn) {
    rate_.reset();
    ignored_until_ = now + kIgnored;
  }
}

// The queue is gone, or it is our own.
bool CrowdShare::is_in_vain(TimePoint now) const {
  return now - queue_told_at_ > kGone || used(now) > kAllOfIt * bytes_per_second(capacity_);
}

// Others were not seen again.
bool CrowdShare::is_doubtful(TimePoint now) const {
  return !competes_ && !queue_.were_confirmed() && now - *entered_at_ > kProbation;
}

// Whether there is enough evidence of others for giving way to them.
bool CrowdShare::finds_others(TimePoint now) {
  const bool stretched = is_stretched(now);
  if (!is_crowded() && !stretched) before_others_ = capacity_;
  if (queue_.are_there()) others_at_ = now;
  const bool is_new = newcomer_.is_new(now);
  const bool is_likely =
      stretched || (is_new && (newcomer_.begins_low() || queue_.newest() > kNoRadio));
  const bool is_evident = is_new ? queue_.may_be_in_the_way() : queue_.are_in_the_way();
  return is_likely && is_evident;
}

void CrowdShare::decide(TimePoint now, Duration round_trip) {
  if (capacity_ <= DataRate{}) return;
  if (!began_at_) began_at_ = now;
  longest_ = std::max(longest_, queue_.newest());
  const bool may_be = asked_ > 0 && now >= ignored_until_;
  if (finds_others(now) && may_be && !rate_) enter(now);
  const bool is_little = used(now) < kHalf * bytes_per_second(capacity_);
  if (competes_ && is_little && queue_.are_there()) competes_until_ = now + kCompetes;
  if (is_crowded() && !competes_) answer_stubborn(now);
  if (is_crowded() && is_doubtful(now) && !queue_.may_be_there()) rate_.reset();
  if (!is_crowded() || now < decide_at_) return;
  saved_ = saved(now);
  saved_at_ = now;
  if (competes_) {
    rate_ = std::min(competing_.at(now, round_trip, wanted(), capacity_), capacity_);
  } else {
    adapt(now);
  }
  decide_at_ = now + std::max(round_trip, kPeriod);
  // A share that nobody contends, and that is enough or whose queue is our own.
  const DataRate enough = std::min(capacity_, rate_of_bytes(kEnough * asked_ / period_));
  const bool is_ours = *rate_ >= enough || queue_.mean() > target(*rate_);
  const bool are_gone = !others_at_ || now - *others_at_ > kCrowdGone;
  const bool leaves = competes_ ? is_in_vain(now) || now > competes_until_ : is_ours && are_gone;
  if (leaves) rate_.reset();
}

bool CrowdShare::is_alone(TimePoint now) const {
  return began_at_ && now - others_at_.value_or(*began_at_) > kGone;
}

double CrowdShare::target(DataRate rate) {
  const double parts = kAtRate / std::max(1.0, 8 * bytes_per_second(rate));
  return std::clamp(kMeanQueue * std::sqrt(parts), kLeastMeanQueue, kMostMeanQueue);
}

void CrowdShare::adapt(TimePoint now) {
  const double over = std::clamp(queue_.mean() / target(*rate_) - 1, -1.0, 2.0);
  if (over > 0) {
    fall(now, over);
  } else if (is_doubtful(now)) {
    rate_ = rate_->scaled(kBack);
  } else {
    const double room = target(*rate_) / std::max(queue_.mean(), kLeastMean);
    rate_ = rate_->scaled(1 - kRise * over * std::clamp(room, 1.0, kQuick));
  }
  before_ = longest_;
  longest_ = queue_.newest();
  const DataRate lowest = over < kFarAbove ? least() : std::min(kOnePacket, capacity_);
  rate_ = std::max(std::min(*rate_, capacity_), lowest);
}

// What nobody asks for is no share to fall from.
void CrowdShare::fall(TimePoint now, double over) {
  if (longest_ < kDrains * before_ || now < fall_at_) return;
  rate_ = std::min(*rate_, rate_of_bytes(asked_ / period_)).scaled(1 - kFall * std::min(1.0, over));
  fall_at_ = now + kBetweenFalls;
}

Duration CrowdShare::waited() const {
  return duration_of(std::max(queue_.mean(), queue_.newest()));
}

}  // namespace interneuron::cc
