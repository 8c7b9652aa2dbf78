// PathReceiver: what has arrived on one path, and the train that came last.
#include "core/flow/arrivals.h"

#include <algorithm>

#include "core/link/path_ecn.h"

namespace interneuron::flow {
namespace {

// Data that come so long after the last packet of a train of probes are no part of it: messages may
// wait in the same queue as probes, but a sender that is not held up is done with both at once.
constexpr Duration kProbePause = std::chrono::milliseconds(1);
// When so many packets behind a gap came within half of it, that gap was a pause before a train and
// no part of one. No measurement behind this value: it only has to be more than what a slow link
// may bring at once.
constexpr std::uint32_t kTailPackets = 4;

// A gap that is longer than ReceivedTrain::kLongestUngranted is one between grants where the one
// before was as long, within a fifth, and is so many gaps ago at most; and where it is no longer
// than this. No measurement behind these values.
constexpr int kPeriods = 4;
constexpr Duration kLongestGrantGap = std::chrono::milliseconds(60);

// For so long a link counts as granted in bursts: what is known of the rate is measured again after
// that time (link::ProbeSchedule).
constexpr Duration kGranted = std::chrono::seconds(10);

void shift_left(wire::AckBitmap& bitmap, std::uint64_t by) {
  if (by >= wire::kAckWindow) {
    bitmap = {};
    return;
  }
  const std::size_t words = by / 64;
  const std::size_t bits = by % 64;
  for (std::size_t i = bitmap.size(); i-- > 0;) {
    std::uint64_t word = i >= words ? bitmap[i - words] << bits : 0;
    if (bits != 0 && i > words) word |= bitmap[i - words - 1] >> (64 - bits);
    bitmap[i] = word;
  }
}

}  // namespace

bool PathReceiver::accept(TimePoint now, std::uint64_t number, Role role, std::size_t ip_bytes,
                          std::uint8_t ecn, bool is_new, std::optional<std::uint32_t> stamp_us) {
  if (number > largest_) {
    const std::uint64_t by = number - largest_;
    if (largest_ != 0 && by > 1) gap_ = true;
    shift_left(bitmap_, by);
    if (largest_ != 0 && by <= wire::kAckWindow) bitmap_[(by - 1) / 64] |= 1ULL << ((by - 1) % 64);
    largest_ = number;
  } else {
    const std::uint64_t back = largest_ - number;
    if (back > wire::kAckWindow) {
      if (!is_new) return false;
    } else {
      if (back == 0) return false;
      std::uint64_t& word = bitmap_[(back - 1) / 64];
      const std::uint64_t bit = 1ULL << ((back - 1) % 64);
      if ((word & bit) != 0) return false;
      word |= bit;
    }
  }
  received_bytes_ += ip_bytes;
  if (ecn == link::kCe) {
    ++ce_;
  } else if (ecn == link::kEct1) {
    ++ect1_;
  } else if (ecn != link::kNotEct) {
    ++ect0_;
  }
  if (role != Role::kNone) extend_train(now, number, role, ip_bytes, stamp_us);
  return true;
}

void PathReceiver::message_ends() { train_.message_ends(); }

void PathReceiver::note_delay(TimePoint now, std::uint32_t stamp_us) {
  // Stamps wrap, and so do delays: only their differences mean anything.
  const std::uint32_t delay = wire::send_stamp(now) - stamp_us;
  const auto above = static_cast<std::int32_t>(delay - largest_delay_);
  if (!largest_is_fresh_ || above > 0) largest_delay_ = delay;
  largest_is_fresh_ = true;
  newest_delay_ = delay;
}

bool PathReceiver::ends_train(TimePoint now, Role role, Duration sent_pause) const {
  if (train_.ends(now, sent_pause) || (role == Role::kProbe && !probing_)) return true;
  const Duration pause =
      std::max<Duration>(kProbePause, ReceivedTrain::kPauseGaps * train_.mean_gap());
  return probing_ && role == Role::kData && now - train_.last > pause;
}

void PathReceiver::extend_train(TimePoint now, std::uint64_t number, Role role,
                                std::size_t ip_bytes, std::optional<std::uint32_t> stamp_us) {
  const Duration gap = now - train_.last;
  Duration apart = gap;
  if (stamp_us && last_stamp_us_) {
    const auto us = static_cast<std::int32_t>(*stamp_us - *last_stamp_us_);
    apart = std::max<Duration>(std::chrono::microseconds(us), Duration::zero());
  }
  last_stamp_us_ = stamp_us;
  // For how long the sender has paused, as far as it shows. Where the packet left soon after the
  // one before, it is the link that was not granted for a while.
  const bool stalled =
      gap > ReceivedTrain::kLongestUngranted && !(apart < gap / 2 && is_regular(now, gap));
  const Duration pause = stalled ? gap : std::min<Duration>(gap, apart);
  if (ends_train(now, role, pause)) {
    train_.begin(now, number);
    tail_ = train_;
    probing_ = role == Role::kProbe;
    return;
  }
  train_.add(now, number, ip_bytes, apart, pause);
  if (train_.spans_grants() && train_.mean_ungranted() > ReceivedTrain::kLongestUngranted) {
    ungranted_ = train_.mean_ungranted();
    granted_at_ = now;
  }
  if (pause > ReceivedTrain::kTrainGap) {
    tail_.begin(now, number);
    gap_before_tail_ = gap;
    return;
  }
  tail_.add(now, number, ip_bytes, apart, pause);
  if (tail_.start != train_.start && tail_.packets >= kTailPackets &&
      now - tail_.first < gap_before_tail_ / 2) {
    train_ = tail_;
  }
}

// Radios stall now and then; grants come regularly.
bool PathReceiver::is_regular(TimePoint now, Duration gap) {
  const bool is_alike = 4 * gap < 5 * long_gap_ && 4 * long_gap_ < 5 * gap;
  const bool is_burst =
      train_.packets > 1 && gap >= ReceivedTrain::kGrantPackets * train_.mean_gap();
  const bool is_regular =
      is_alike && is_burst && now - long_gap_at_ <= kPeriods * gap && gap <= kLongestGrantGap;
  long_gap_ = gap;
  long_gap_at_ = now;
  return is_regular;
}

// What one grant has brought is no rate, and what two have is next to none.
bool PathReceiver::tells_rate(TimePoint now) const {
  if (!train_.even()) return false;
  const bool granted = granted_at_ && now - *granted_at_ < kGranted;
  return !granted || train_.spans_grants() || train_.last - train_.first > 2 * ungranted_;
}

void PathReceiver::exchange(TimePoint now, PeerTime u) {
  if (u_ && wrapping_sub(u.time_since_epoch().count(), u_->time_since_epoch().count()) < 0) return;
  u_ = u;
  u_at_ = now;
}

wire::LinkReport PathReceiver::report(TimePoint now) const {
  wire::LinkReport report;
  report.link = link_;
  if (u_) {
    report.has_exchange = true;
    report.s = *u_;
    report.h = now - u_at_;
  }
  report.largest = largest_;
  report.bitmap = bitmap_;
  report.train_start = train_.start;
  if (tells_rate(now)) {
    report.train_packets = train_.packets;
    report.train_rate = train_.rate();
  }
  report.has_delays = newest_delay_.has_value();
  report.newest_delay_us = newest_delay_.value_or(0);
  report.largest_delay_us = largest_delay_;
  report.ect0_packets = ect0_;
  report.ect1_packets = ect1_;
  report.ce_packets = ce_;
  report.received_bytes = received_bytes_;
  return report;
}

}  // namespace interneuron::flow
