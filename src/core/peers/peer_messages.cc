// What a peer sends: pieces become messages within its limits, and what strikes these is kept in
// its ledger.
#include <algorithm>

#include "core/peers/peer.h"

namespace interneuron {
namespace {

// How far apart limits that strike one peer are told of. No measurement behind this value: it only
// has to be short for a person who waits, and long for a log.
constexpr Duration kBetweenLimits = std::chrono::seconds(1);

}  // namespace

std::optional<Peer::Outcome> Peer::handle_computed(TimePoint now, std::size_t room) {
  const auto data = windows_.poll();
  if (!data) return std::nullopt;
  Outcome outcome;
  take_piece(now, *data, room, outcome);
  return outcome;
}

bool Peer::is_too_large(const wire::Data& data) const {
  const wire::FragmentHeader& f = data.fragment;
  const PeerLimits& limits = identity_.limits;
  if (f.kind == wire::MessageKind::kRevocations) return f.size > kMaxRevocationsBytes;
  if (f.kind == wire::MessageKind::kRound) {
    return f.size > limits.round_bytes + wire::kRoundHeaderBytes;
  }
  if (f.size <= limits.plain_bytes + wire::kPlainHeaderBytes && limits.channel_bytes.empty()) {
    return false;
  }
  // Only the first piece says which channel it is.
  const auto header =
      f.index == 0 ? wire::parse_plain_header(data.bytes) : std::optional<wire::PlainHeader>{};
  std::size_t most = limits.plain_bytes;
  for (const auto& [channel, bytes] : limits.channel_bytes) {
    if (!header) most = std::max(most, bytes);
    if (header && header->channel == channel) most = bytes;
  }
  return f.size > most + wire::kPlainHeaderBytes;
}

void Peer::refuse(TimePoint now, const wire::FragmentHeader& fragment, PeerLimit why,
                  Outcome& outcome) {
  strike(now, why);
  outcome.refused = true;
  reassembler_.refuse(fragment);
  receipts_.refuse(now, fragment.message);
}

bool Peer::take_piece(TimePoint now, const wire::Data& data, std::size_t room, Outcome& outcome) {
  if (is_too_large(data)) {
    refuse(now, data.fragment, PeerLimit::kMessageSize, outcome);
    return false;
  }
  const Duration lifetime = std::chrono::microseconds(data.fragment.lifetime_us);
  ledger_.longest_lifetime =
      std::max(ledger_.longest_lifetime, std::min(lifetime, identity_.limits.longest_deadline));
  flow::ClockBounds clocks{identity_.self, identity_.session, std::nullopt};
  if (data.fragment.index == 0) clocks.peer_hi_min = clock_.hi_min(now);
  flow::Reassembler::Outcome taken = reassembler_.add(now, data, clocks, room);
  const MessageId message = data.fragment.message;
  if (taken.limited) strike(now, PeerLimit::kReassembly);
  outcome.bad_piece = taken.result == flow::Reassembler::Result::kBad;
  if (taken.result == flow::Reassembler::Result::kRefused) {
    outcome.refused = true;
    receipts_.refuse(now, message);
  }
  tell_forgotten(now);
  if (taken.result == flow::Reassembler::Result::kComplete) {
    if (!message_limit_.take(now)) {
      refuse(now, data.fragment, PeerLimit::kMessageRate, outcome);
      return false;
    }
    known_ = true;
    note_activity(now);
    receipts_.complete(now, message);
    feedback_.completed(now);
    outcome.message_id = message;
    outcome.kind = data.fragment.kind;
    outcome.message = std::move(taken.message);
  }
  return !outcome.bad_piece && !outcome.refused;
}

// Acknowledgements tell of packets for a short time only, so that the sender of many would not know
// whether what was late has arrived in the end.
void Peer::tell_forgotten(TimePoint now) {
  while (const auto message = reassembler_.poll_forgotten()) {
    receipts_.refuse(now, *message);
    feedback_.has_news(now);
  }
}

void Peer::strike(TimePoint now, PeerLimit limit) {
  ++ledger_.strikes[static_cast<std::size_t>(limit)];
  if (now < tell_limit_at_) return;
  tell_limit_at_ = now + kBetweenLimits;
  known_ = true;
  limited_ = limit;
}

PeerLedger Peer::ledger() const {
  PeerLedger out = ledger_;
  out.reassembly_messages = reassembler_.messages();
  out.reassembly_bytes = reassembly_bytes();
  return out;
}

}  // namespace interneuron
