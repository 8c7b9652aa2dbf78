// PathReceiver: what has arrived on one path, and the train that came last.
#include "core/flow/arrivals.h"

#include <algorithm>

#include "core/base/slow_link.h"
#include "core/link/path_ecn.h"
#include "interneuron/sizes.h"

namespace interneuron::flow {
namespace {

// A pause of this or less never ends a train: uplinks of cellular networks are granted in bursts of
// 1 to 10 ms (docs/constants.md, "Rate of a link").
constexpr Duration kTrainGap = std::chrono::milliseconds(10);
// A pause longer than this many mean gaps of the train ends it. No measurement behind this value:
// it only has to be larger than gaps differ that are not of the sender's making.
constexpr int kPauseGaps = 4;
// A pause longer than this always ends a train: a full packet takes 114 ms at 0.1 Mbit/s, and one
// in between may be lost.
constexpr Duration kLongestGap = std::chrono::milliseconds(300);
// A train longer than this measures the source and not the link, or an average over a change of the
// rate. No measurement behind this value: it only has to be larger than what a message takes to
// arrive.
constexpr Duration kMaxTrain = std::chrono::milliseconds(200);
// A slow link may take longer for so many packets, but not longer than kMaxSlowTrain.
constexpr std::uint32_t kSlowTrainPackets = 8;
constexpr Duration kMaxSlowTrain = std::chrono::seconds(1);
// A train that is shorter than both says nothing yet (RateEstimator): it goes on whatever pause
// follows.
constexpr std::uint32_t kToldPackets = 16;
constexpr Duration kTold = std::chrono::milliseconds(5);
// Data that come so long after the last packet of a train of probes are no part of it: messages may
// wait in the same queue as probes, but a sender that is not held up is done with both at once.
constexpr Duration kProbePause = std::chrono::milliseconds(1);
// Where the last packet of a few is short, its gap is: they come evenly all the same where no byte
// took longer than this times the mean, which is what the rule for packets of one size allows three
// of them.
constexpr double kEven = 4.0 / 3;
constexpr std::uint32_t kLeastEven = 3;
// When so many packets behind a gap came within half of it, that gap was a pause before a train and
// no part of one. No measurement behind this value: it only has to be more than what a slow link
// may bring at once.
constexpr std::uint32_t kTailPackets = 4;

// A gap between packets that left at once is the link's, which is not granted all the time, where
// it is longer than the first of these; grants are at most the second apart, and what is longer is
// no grant's, but a stall of the radio (docs/constants.md, "Rate of a link").
constexpr Duration kLeastUngranted = std::chrono::milliseconds(2);
constexpr Duration kLongestUngranted = std::chrono::milliseconds(25);

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

void PathReceiver::Train::begin(TimePoint now, std::uint64_t number) {
  *this = {.start = number, .packets = 1, .first = now, .last = now};
}

// `apart`: the packet left so long after the one before.
void PathReceiver::Train::add(TimePoint now, std::size_t ip_bytes, Duration apart) {
  ++packets;
  bytes += ip_bytes;
  const Duration gap = now - last;
  longest_gap = std::max<Duration>(longest_gap, gap);
  most_ns_per_byte =
      std::max(most_ns_per_byte, static_cast<double>(gap.count()) / static_cast<double>(ip_bytes));
  const bool is_the_links = gap > kLeastUngranted && gap <= kLongestUngranted && apart < gap / 2;
  if (is_the_links) ungranted = std::max<Duration>(ungranted, gap);
  sent += apart;
  last = now;
}

// Where the link was not granted all the time, the train may have begun and ended anywhere between
// two grants: half a gap more is right in the mean. A train that took no longer than it left and
// one such half shows how fast it left, and of the link that it carries that; one that took no
// longer than it left and a gap may show either.
DataRate PathReceiver::Train::rate() const {
  Duration took = last - first;
  if (took <= sent + ungranted / 2) {
    took = ungranted > Duration::zero() ? std::min(took, sent) : took;
  } else if (took > sent + ungranted) {
    took += ungranted / 2;
  }
  return rate_of(bytes, took);
}

bool PathReceiver::Train::ends(TimePoint now, Duration pause) const {
  if (packets == 0 || closed) return true;
  const Duration gap = now - last;
  if (gap > kLongestGap) return true;
  const Duration length = now - first;
  if (length > kMaxSlowTrain || (length > kMaxTrain && packets >= kSlowTrainPackets)) return true;
  const bool paused = pause > std::max<Duration>(kTrainGap, kPauseGaps * mean_gap());
  const bool told = packets >= kToldPackets || last - first >= kTold;
  return paused && told;
}

bool PathReceiver::Train::even() const {
  if (packets >= kToldPackets || 3 * longest_gap <= 2 * (last - first)) return true;
  const double ns = static_cast<double>(Duration(last - first).count());
  return packets >= kLeastEven && most_ns_per_byte * static_cast<double>(bytes) <= kEven * ns;
}

// Over a slow path messages follow each other so closely that no pause between them is longer than
// four of their gaps: one train would go on over several of them and show what was sent. So would
// one of small packets, wherever it ended.
void PathReceiver::message_ends() {
  const bool is_large = 2 * train_.bytes >= kMaxPacketBytes * (train_.packets - 1);
  train_.closed =
      is_large && train_.even() && is_slow(rate_of(train_.bytes, train_.last - train_.first));
}

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
  const Duration pause = std::max<Duration>(kProbePause, kPauseGaps * train_.mean_gap());
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
  const Duration pause = gap > kLongestUngranted ? gap : std::min<Duration>(gap, apart);
  if (ends_train(now, role, pause)) {
    train_.begin(now, number);
    tail_ = train_;
    probing_ = role == Role::kProbe;
    return;
  }
  train_.add(now, ip_bytes, apart);
  if (pause > kTrainGap) {
    tail_.begin(now, number);
    gap_before_tail_ = gap;
    return;
  }
  tail_.add(now, ip_bytes, apart);
  if (tail_.start != train_.start && tail_.packets >= kTailPackets &&
      now - tail_.first < gap_before_tail_ / 2) {
    train_ = tail_;
  }
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
  if (train_.even()) {
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
