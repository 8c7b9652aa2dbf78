#include "core/peers/intake.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/wire/plain_header.h"

namespace interneuron::peers {
namespace {

// How far apart limits that strike one peer are told of. No measurement behind this value: it only
// has to be short for a person who waits, and long for a log.
constexpr Duration kBetweenLimits = std::chrono::seconds(1);
// What may come at once is what the limits of rates let come in this time: links that were away for
// a moment bring all that was under way. No measurement behind this value.
constexpr Duration kLimitBurst = std::chrono::milliseconds(250);

}  // namespace

Intake::Intake(const PeerLimits& limits, TimePoint now)
    : feedback(now),
      limits_(limits),
      reassembler_({.bytes = limits.reassembly_bytes,
                    .messages = limits.reassembly_messages,
                    .life = limits.longest_deadline}),
      packet_limit_(limits.packets_per_second, kLimitBurst),
      message_limit_(limits.messages_per_second, kLimitBurst) {}

void Intake::reset() {
  Intake fresh(limits_, feedback.sent_at());
  // Another session gives a peer no other limits, and what has struck it stays in its ledger.
  fresh.packet_limit_ = packet_limit_;
  fresh.message_limit_ = message_limit_;
  fresh.ledger_ = ledger_;
  fresh.limited_ = limited_;
  fresh.tell_limit_at_ = tell_limit_at_;
  fresh.is_known_ = is_known_;
  *this = std::move(fresh);
}

bool Intake::may_come(TimePoint now) {
  const bool may = packet_limit_.take(now);
  if (!may) strike(now, PeerLimit::kPacketRate);
  return may;
}

bool Intake::is_too_large(const wire::Data& data) const {
  const wire::FragmentHeader& f = data.fragment;
  if (f.kind == wire::MessageKind::kRevocations) return f.size > kMaxRevocationsBytes;
  if (f.kind == wire::MessageKind::kRound) {
    return f.size > limits_.round_bytes + wire::kRoundHeaderBytes;
  }
  // Only the first piece says which channel it is, and how long the header is.
  const auto header =
      f.index == 0 ? wire::parse_plain_header(data.bytes) : std::optional<wire::PlainHeader>{};
  const std::size_t head = header ? header->bytes() : wire::kMostPlainHeaderBytes;
  if (f.size <= limits_.plain_bytes + head && limits_.channel_bytes.empty()) return false;
  std::size_t most = limits_.plain_bytes;
  for (const auto& [channel, bytes] : limits_.channel_bytes) {
    if (!header) most = std::max(most, bytes);
    if (header && header->channel == channel) most = bytes;
  }
  return f.size > most + head;
}

void Intake::refuse(TimePoint now, const wire::FragmentHeader& fragment, PeerLimit why,
                    PacketOutcome& outcome) {
  strike(now, why);
  outcome.refused = true;
  reassembler_.refuse(fragment);
  receipts.refuse(now, fragment.message);
}

bool Intake::take_piece(TimePoint now, const wire::Data& data, const flow::ClockBounds& clocks,
                        std::size_t room, PacketOutcome& outcome) {
  if (is_too_large(data)) {
    refuse(now, data.fragment, PeerLimit::kMessageSize, outcome);
    return false;
  }
  const Duration lifetime = std::chrono::microseconds(data.fragment.lifetime_us);
  ledger_.longest_lifetime =
      std::max(ledger_.longest_lifetime, std::min(lifetime, limits_.longest_deadline));
  flow::Reassembler::Outcome taken = reassembler_.add(now, data, clocks, room);
  const MessageId message = data.fragment.message;
  if (taken.limited) strike(now, PeerLimit::kReassembly);
  outcome.missing = taken.missing;
  outcome.bad_piece = taken.result == flow::Reassembler::Result::kBad;
  if (taken.result == flow::Reassembler::Result::kRefused) {
    outcome.refused = true;
    receipts.refuse(now, message);
  }
  tell_forgotten(now);
  if (taken.result == flow::Reassembler::Result::kComplete) {
    if (!message_limit_.take(now)) {
      refuse(now, data.fragment, PeerLimit::kMessageRate, outcome);
      return false;
    }
    is_known_ = true;
    receipts.complete(now, message);
    feedback.completed(now);
    outcome.message_id = message;
    outcome.kind = data.fragment.kind;
    outcome.message = std::move(taken.message);
  }
  return !outcome.bad_piece && !outcome.refused;
}

// Acknowledgements tell of packets for a short time only, so that the sender of many would not know
// whether what was late has arrived in the end.
void Intake::tell_forgotten(TimePoint now) {
  while (const auto message = reassembler_.poll_forgotten()) {
    receipts.refuse(now, *message);
    feedback.has_news(now);
  }
}

std::size_t Intake::handle_timeout(TimePoint now) {
  windows_.handle_timeout(now);
  const std::size_t expired = reassembler_.expire(now);
  tell_forgotten(now);
  return expired;
}

std::optional<TimePoint> Intake::next_timeout() const {
  return earliest(reassembler_.next_timeout(), windows_.next_timeout());
}

void Intake::strike(TimePoint now, PeerLimit limit) {
  ++ledger_.strikes[static_cast<std::size_t>(limit)];
  if (now < tell_limit_at_) return;
  tell_limit_at_ = now + kBetweenLimits;
  is_known_ = true;
  limited_ = limit;
}

PeerLedger Intake::ledger() const {
  PeerLedger out = ledger_;
  out.reassembly_messages = reassembler_.messages();
  out.reassembly_bytes = bytes();
  return out;
}

}  // namespace interneuron::peers
