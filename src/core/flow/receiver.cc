#include "core/flow/receiver.h"

#include <algorithm>
#include <cstring>

#include "core/code/erasure_code.h"
#include "core/link/path_ecn.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "interneuron/send.h"

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
// When so many packets behind a gap came within half of it, that gap was a pause before a train and
// no part of one. No measurement behind this value: it only has to be more than what a slow link
// may bring at once.
constexpr std::uint32_t kTailPackets = 4;

// A message expires this much after t0 + hi_min + D_N (docs/paper.md, "Expiry at a receiver").
constexpr Duration kExpirySlack = std::chrono::milliseconds(2);

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
                          std::uint8_t ecn, bool is_new) {
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
  } else if (ecn != link::kNotEct) {
    ++ect_;
  }
  if (role != Role::kNone) extend_train(now, number, role, ip_bytes);
  return true;
}

void PathReceiver::Train::begin(TimePoint now, std::uint64_t number) {
  *this = {.start = number, .packets = 1, .bytes = 0, .first = now, .last = now, .longest_gap = {}};
}

void PathReceiver::Train::add(TimePoint now, std::size_t ip_bytes) {
  ++packets;
  bytes += ip_bytes;
  longest_gap = std::max<Duration>(longest_gap, now - last);
  last = now;
}

bool PathReceiver::Train::ends(TimePoint now) const {
  if (packets == 0) return true;
  const Duration gap = now - last;
  if (gap > kLongestGap) return true;
  const Duration length = now - first;
  if (length > kMaxSlowTrain || (length > kMaxTrain && packets >= kSlowTrainPackets)) return true;
  const bool pause = gap > std::max<Duration>(kTrainGap, kPauseGaps * mean_gap());
  const bool told = packets >= kToldPackets || last - first >= kTold;
  return pause && told;
}

bool PathReceiver::Train::even() const {
  return packets >= kToldPackets || 3 * longest_gap <= 2 * (last - first);
}

void PathReceiver::note_delay(TimePoint now, std::uint32_t stamp_us) {
  // Stamps wrap, and so do delays: only their differences mean anything.
  const std::uint32_t delay = wire::send_stamp(now) - stamp_us;
  const auto above = static_cast<std::int32_t>(delay - largest_delay_);
  if (!largest_is_fresh_ || above > 0) largest_delay_ = delay;
  largest_is_fresh_ = true;
  newest_delay_ = delay;
}

bool PathReceiver::ends_train(TimePoint now, Role role) const {
  if (train_.ends(now) || (role == Role::kProbe && !probing_)) return true;
  const Duration pause = std::max<Duration>(kProbePause, kPauseGaps * train_.mean_gap());
  return probing_ && role == Role::kData && now - train_.last > pause;
}

void PathReceiver::extend_train(TimePoint now, std::uint64_t number, Role role,
                                std::size_t ip_bytes) {
  if (ends_train(now, role)) {
    train_.begin(now, number);
    tail_ = train_;
    probing_ = role == Role::kProbe;
    return;
  }
  const Duration gap = now - train_.last;
  train_.add(now, ip_bytes);
  if (gap > kTrainGap) {
    tail_.begin(now, number);
    gap_before_tail_ = gap;
    return;
  }
  tail_.add(now, ip_bytes);
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
    report.train_rate = rate_of(train_.bytes, train_.last - train_.first);
  }
  report.has_delays = newest_delay_.has_value();
  report.newest_delay_us = newest_delay_.value_or(0);
  report.largest_delay_us = largest_delay_;
  report.ect_packets = ect_;
  report.ce_packets = ce_;
  report.received_bytes = received_bytes_;
  return report;
}

Reassembler::Outcome Reassembler::refuse_for_now(const wire::FragmentHeader& f) {
  if (f.kind == wire::MessageKind::kPlain) refuse(f);
  return {Result::kRefused, {}, true};
}

void Reassembler::refuse(const wire::FragmentHeader& f) {
  if (by_id_.find(f.message)) {
    give_up(f.message);
  } else if (f.kind == wire::MessageKind::kPlain) {
    refused_.insert(f.message);
  } else {
    buried_.insert(f.message);
  }
}

std::optional<Reassembler::Outcome> Reassembler::answer(const wire::Data& data, std::size_t room) {
  const wire::FragmentHeader& f = data.fragment;
  if (f.size > kMaxMessageBytes + wire::MessageBytes::kMostHeaderBytes) return refuse_for_now(f);
  const bool is_whole = f.count() == 1 && !f.is_repair();
  if (!is_whole) {
    // No datagram could bring the other pieces.
    if (f.chunk > code::kMostBytes) return Outcome{Result::kBad, {}};
    return std::nullopt;
  }
  if (f.size > room) return refuse_for_now(f);
  const std::size_t header = std::min<std::size_t>(f.size, wire::header_bytes(f.kind));
  const ByteView payload = data.bytes.subspan(header);
  buried_.insert(f.message);
  return Outcome{Result::kComplete,
                 {data.bytes.first(header), Bytes(payload.begin(), payload.end())}};
}

Reassembler::Outcome Reassembler::add(TimePoint now, const wire::Data& data,
                                      const ClockBounds& clocks, std::size_t room) {
  const wire::FragmentHeader& f = data.fragment;
  if (buried_.contains(f.message) || refused_.contains(f.message)) {
    return {Result::kDuplicate, {}};
  }
  const std::size_t before = by_id_.size();
  auto place = by_id_.find(f.message);
  const bool is_new = !place;
  if (is_new) {
    if (auto answered = answer(data, room)) return std::move(*answered);
    const Duration lifetime = std::chrono::microseconds(f.lifetime_us);
    const TimePoint too_late =
        saturating_add(now, std::min<Duration>(lifetime, kLongestDeadline + kExpirySlack));
    const TimePoint expires = std::min(too_late, saturating_add(now, limits_.life));
    if (!make_room(Partial::first_growth(f), expires, room, true)) return refuse_for_now(f);
    place = open(f, too_late, expires);
  } else {
    const Partial& p = places_[*place].partial;
    if (!p.fits(f)) return {Result::kBad, {}};
    if (p.has(f.index)) return {Result::kDuplicate, {}};
    if (!make_room(p.growth(f.index), places_[*place].expires, room, false)) {
      return refuse_for_now(f);
    }
  }
  const std::size_t gone = before + (is_new ? 1 : 0) - by_id_.size();
  Outcome out = take(now, *place, data, clocks);
  out.limited = gone > 0;
  return out;
}

Reassembler::Outcome Reassembler::take(TimePoint now, std::uint32_t place, const wire::Data& data,
                                       const ClockBounds& clocks) {
  Partial& p = places_[place].partial;
  const MessageId message = data.fragment.message;
  const std::size_t held = p.held();
  p.add(data.fragment.index, data.bytes);
  bytes_ += p.held() - held;
  if (p.complete()) {
    Outcome done{Result::kComplete, p.take()};
    bury(message);
    buried_.insert(message);
    return done;
  }
  Place& at = places_[place];
  if (data.fragment.index == 0) refine_expiry(place, data, clocks);
  if (at.expires < at.too_late) {
    at.expires = std::min(at.too_late, saturating_add(now, limits_.life));
    expiries_.set(place, at.expires);
  }
  return {Result::kStored, {}};
}

// The place of a message that begins with this fragment.
std::uint32_t Reassembler::open(const wire::FragmentHeader& f, TimePoint too_late,
                                TimePoint expires) {
  if (free_.empty()) {
    free_.push_back(static_cast<std::uint32_t>(places_.size()));
    places_.emplace_back();
  }
  const std::uint32_t place = free_.back();
  free_.pop_back();
  Place& p = places_[place];
  p.id = f.message;
  p.partial.begin(f);
  p.too_late = too_late;
  p.expires = expires;
  bytes_ += p.partial.held();
  by_id_.insert(f.message, place);
  expiries_.set(place, expires);
  return place;
}

// The refined expiry is never early, since the true clock offset is at most `hi`.
void Reassembler::refine_expiry(std::uint32_t place, const wire::Data& first,
                                const ClockBounds& clocks) {
  PeerTime t0{};
  Duration deadline{};
  SessionId origin = clocks.peer;
  if (first.fragment.kind == wire::MessageKind::kPlain) {
    const auto header = wire::parse_plain_header(first.bytes);
    if (!header) return;
    t0 = header->t0;
    deadline = header->deadline();
  } else {
    const auto header = wire::parse_round_header(first.bytes);
    if (!header) return;
    t0 = header->t0;
    deadline = header->deadline();
    origin = header->round.origin;
  }
  const auto hi = clocks.above(origin);
  if (!hi) return;
  const Duration allowed = deadline + kExpirySlack;
  const TimePoint by_clock = when_elapsed(t0, Duration{wrapping_add(hi->count(), allowed.count())});
  Place& at = places_[place];
  at.too_late = std::min(at.too_late, by_clock);
  at.expires = std::min(at.expires, at.too_late);
  expiries_.set(place, at.expires);
}

bool Reassembler::make_room(std::size_t size, TimePoint expires, std::size_t room, bool is_new) {
  const bool is_full = is_new && by_id_.size() >= limits_.messages;
  const std::size_t most = bytes_ + std::min(room, limits_.bytes - std::min(limits_.bytes, bytes_));
  if (!is_full && bytes_ + size <= most) return true;
  std::size_t older = 0;
  for (const Place& place : places_) {
    if (place.partial.is_open() && place.expires < expires) older += place.partial.held();
  }
  // Nothing goes where it would not suffice.
  if (bytes_ - older + size > most || (is_full && older == 0)) return false;
  if (is_full) forget_first();
  while (bytes_ + size > most) forget_first();
  return true;
}

// The message that expires first goes.
void Reassembler::forget_first() {
  const MessageId first = places_[*expiries_.due(*expiries_.earliest())].id;
  give_up(first);
  forgotten_.push_back(first);
}

// It is incomplete and stays so.
void Reassembler::give_up(MessageId message) {
  const bool is_plain = places_[*by_id_.find(message)].partial.kind() == wire::MessageKind::kPlain;
  bury(message);
  if (is_plain) {
    refused_.insert(message);
  } else {
    buried_.insert(message);
  }
}

void Reassembler::bury(MessageId message) {
  const auto place = by_id_.find(message);
  if (!place) return;
  Partial& partial = places_[*place].partial;
  bytes_ -= partial.held();
  partial.end();
  expiries_.remove(*place);
  by_id_.erase(message);
  free_.push_back(*place);
}

std::size_t Reassembler::expire(TimePoint now) {
  std::size_t gone = 0;
  for (; const auto place = expiries_.due(now); ++gone) {
    const MessageId message = places_[*place].id;
    if (places_[*place].partial.kind() == wire::MessageKind::kPlain) forgotten_.push_back(message);
    give_up(message);
  }
  return gone;
}

std::optional<TimePoint> Reassembler::next_timeout() const { return expiries_.earliest(); }

void Reassembler::reset() { *this = Reassembler(limits_); }

}  // namespace interneuron::flow
