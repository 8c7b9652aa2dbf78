#include "core/cc/queue_of_others.h"

#include <algorithm>
#include <cmath>

#include "interneuron/sizes.h"

namespace interneuron::cc {
namespace {

// 48 of them cover a round trip of 40 ms behind a queue of 300 ms.
constexpr Duration kSlot = std::chrono::milliseconds(8);
constexpr Duration kForgotten = std::chrono::minutes(1);
// Memory of the mean queue, in seconds: a few round trips, and longer than the 100 ms between the
// frames of a camera. No measurement behind this value.
constexpr double kMeanMemory = 0.15;
// Memory of what others add. With half of it the delays of a radio (docs/paper.md, "The
// baseline after ERDOS") are taken for others, with more of it a crowd is found too late.
constexpr double kOthersMemory = 0.3;
// Two packets further apart than this say nothing of the time between them.
constexpr double kLongestApart = 0.3;
// A single packet adds no more than this: a radio that is late once is no crowd.
constexpr double kMostAdded = 0.03;
// Our own bytes count so many times: the pipe may be half as fast as believed.
constexpr double kOwnWeight = 2;
// A queue grows by no more than this and kFastest times the time between two packets: frames of
// four cameras may come at once, and what is beyond was held up as a whole.
constexpr double kMostAtOnce = 0.012;
constexpr double kFastest = 1.5;
// Packets with nothing of ours between them count in a row where they are this far apart: less
// is a batch.
constexpr double kApart = 0.015;
// What others must have added for a packet to count in a row, and what ends the row.
constexpr double kMuch = 0.014;
constexpr double kNothing = 0.003;
constexpr int kRow = 2;
// What others must have added in the mean to be in the way, to be there, to be seen again, to be
// suspected on a path that is new, and for them not to be gone. Measured in crowds of 10 to 50
// vehicles, and below what radio varies by where they would convict alone; no other measurement
// behind these values.
constexpr double kInTheWay = 0.012;
constexpr double kThere = 0.0065;
constexpr double kSeenAgain = 0.006;
constexpr double kSuspected = 0.003;
constexpr double kNobody = 0.002;
constexpr int kConfirmations = 2;
// A pipe carries one packet after the other, and a radio in grants of one or a few, so that what a
// packet waits for varies by the time of some: a queue of so few is nobody's. At 20 Mbit/s that is
// 1.5 ms, which changes nothing, and at 3 Mbit/s 10 ms. Without it the fades of drives of 1 to 3
// Mbit/s are taken for others, and `stripe` misses an eighth more. But who measures a pipe while
// fifty others do believes in a fiftieth of it, and would see nobody: where fifty vehicles begin at
// one instant, 86 % of what is possible is on time with the bound in seconds, and 81 % without it.
constexpr std::size_t kGrain = 3;
constexpr double kLongestGrain = 0.012;
// They are not in the way where the queue is no longer than what is aimed at anyhow, which a CUBIC
// flow keeps on a buffer of 30 ms.
constexpr double kLongQueue = 0.032;
// A newcomer holds its best back at a shorter queue already: half of that.
constexpr double kShort = 0.015;
// A packet that waited for so much more than ours before it met others, in seconds: more than
// clocks and the steps of an event loop add.
constexpr double kMet = 0.0015;
// A queue of so few packets is nobody's: heartbeats and what repairs take are not counted.
constexpr std::size_t kFewPackets = 2;
// What left so soon after evidence began to count met the same queue.
constexpr Duration kSameQueue = std::chrono::milliseconds(20);

std::uint32_t micros(TimePoint at) {
  return static_cast<std::uint32_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(at.time_since_epoch()).count());
}

double decayed(double old, double fresh, double seconds, double memory) {
  return fresh + (old - fresh) * std::exp(-seconds / memory);
}

}  // namespace

// Slots are told apart by times modulo 2^32, so that none is kept over a long pause.
void SentBytes::sent(TimePoint now, std::size_t ip_bytes) {
  if (used_ > 0 && now - newest_at_ > kForgotten) used_ = 0;
  if (used_ == 0 || now - newest_at_ >= kSlot) {
    newest_ = (newest_ + 1) % kSlots;
    newest_at_ = now;
    used_ = std::min(used_ + 1, kSlots);
    slots_[newest_] = {micros(now), static_cast<std::uint32_t>(all_)};
  }
  all_ += ip_bytes;
}

std::uint32_t SentBytes::by(TimePoint at) const {
  constexpr auto kSlotUs = std::chrono::duration_cast<std::chrono::microseconds>(kSlot).count();
  auto next = static_cast<std::uint32_t>(all_);
  for (std::size_t back = 0; back < used_; ++back) {
    const Slot& slot = slots_[(newest_ + kSlots - back) % kSlots];
    const auto since = static_cast<std::int32_t>(micros(at) - slot.start_us);
    if (since >= 0) return since >= kSlotUs ? next : slot.before;
    next = slot.before;
  }
  return next;
}

std::uint32_t SentBytes::by_end_of_slot(TimePoint at) const { return by(at + kSlot); }

void QueueOfOthers::met(TimePoint now, TimePoint left_at, Duration waited, DataRate capacity) {
  const double all = to_seconds(waited);
  if (left_at_) {
    const double jump = all - held_up_ - newest_;
    const double apart = std::abs(to_seconds(left_at - *left_at_));
    if (jump > kMostAtOnce + kFastest * apart) held_up_ += jump;
  }
  held_up_ = std::clamp(held_up_, 0.0, std::max(all, 0.0));
  const double met = std::max(all - held_up_, 0.0);
  suspect(left_at, met, capacity);
  judge(left_at, met, capacity);
  mean_ = left_at_ ? decayed(mean_, met, to_seconds(now - met_at_), kMeanMemory) : met;
  newest_ = met;
  left_at_ = left_at;
  met_at_ = now;
}

// What a packet waited for where all of ours since the packet before it was just in front of it.
void QueueOfOthers::suspect(TimePoint left_at, double met, DataRate capacity) {
  if (!left_at_ || left_at <= *left_at_ || capacity <= DataRate{}) return;
  const double apart = to_seconds(left_at - *left_at_);
  if (apart > kLongestApart) return;
  const std::uint32_t sent = sent_.by_end_of_slot(left_at) - sent_.by(*left_at_);
  const std::size_t ours = sent + kFewPackets * kMaxPacketBytes;
  const double own = std::max(0.0, newest_ - apart) + to_seconds(capacity.transmit_time(ours));
  were_met_ = were_met_ || met - own > kMet;
  suspected_ = decayed(suspected_, std::clamp(met - own, 0.0, kMostAdded), apart, kOthersMemory);
}

// What others have added since the packet before this one left.
void QueueOfOthers::judge(TimePoint left_at, double met, DataRate capacity) {
  if (!left_at_ || left_at <= *left_at_) return;
  const double apart = to_seconds(left_at - *left_at_);
  if (apart > kLongestApart) return;
  grain_ = std::min(kLongestGrain, to_seconds(capacity.transmit_time(kGrain * kMaxPacketBytes)));
  const auto ours = static_cast<std::int32_t>(sent_.by(left_at) - sent_.by(*left_at_));
  const double own =
      kOwnWeight * to_seconds(capacity.transmit_time(static_cast<std::size_t>(std::max(ours, 0))));
  const double added = met - std::max(0.0, newest_ + own - apart);
  others_ = decayed(others_, std::clamp(added, 0.0, kMostAdded), apart, kOthersMemory);
  if (ours > 0 || apart <= kApart) return;
  if (exceeds(added, kMuch)) ++in_a_row_;
  if (added < kNothing) in_a_row_ = 0;
  if (exceeds(added, kSeenAgain) && left_at > since_ + kSameQueue) ++confirmed_;
}

void QueueOfOthers::clock_stepped() {
  left_at_.reset();
  newest_ = mean_ = others_ = suspected_ = held_up_ = 0;
}

void QueueOfOthers::begin_again(TimePoint now) {
  since_ = now;
  confirmed_ = 0;
  in_a_row_ = 0;
}

// Whether so much of a queue is evidence of others.
bool QueueOfOthers::exceeds(double queue, double least) const {
  return queue > std::max(least, grain_);
}

bool QueueOfOthers::may_be_there() const { return others_ > kNobody; }

bool QueueOfOthers::are_there() const { return exceeds(others_, kThere) || in_a_row_ >= kRow; }

bool QueueOfOthers::are_in_the_way() const {
  return (exceeds(others_, kInTheWay) || in_a_row_ >= kRow) && newest_ > kLongQueue;
}

bool QueueOfOthers::may_be_in_the_way() const {
  return (others_ > kSuspected || in_a_row_ >= kRow) && newest_ > kLongQueue;
}

bool QueueOfOthers::others_are_suspected() const {
  return suspected_ > kSuspected && newest_ > kShort;
}

bool QueueOfOthers::were_confirmed() const {
  return confirmed_ >= kConfirmations || exceeds(others_, kSeenAgain);
}

}  // namespace interneuron::cc
