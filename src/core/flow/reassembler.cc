#include "core/flow/reassembler.h"

#include <algorithm>

#include "core/code/erasure_code.h"
#include "core/wire/plain_header.h"
#include "core/wire/round_header.h"
#include "interneuron/send.h"

namespace interneuron::flow {
namespace {

// A message expires this much after t0 + hi_min + D_N (docs/paper.md, "Expiry at a receiver").
constexpr Duration kExpirySlack = std::chrono::milliseconds(2);

}  // namespace

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
  const std::size_t header = std::min<std::size_t>(f.size, wire::header_bytes(f.kind, data.bytes));
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
  return {.result = Result::kStored, .message = {}, .missing = p.missing()};
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

}  // namespace interneuron::flow
