// What becomes of messages on a path that may have fallen silent: which of them move to another
// one.
#include <algorithm>

#include "core/flow/planners.h"

namespace interneuron::flow {

std::map<MessageId, std::size_t> owed_by(const Traffic& traffic, const SendPath& path) {
  std::map<MessageId, std::size_t> owed;
  path.sent.for_each_in_flight([&](const SentPackets::Piece& piece) {
    const OutgoingMessage* m = traffic.messages.find(piece.message);
    if (m != nullptr && !m->pieces[piece.index].acknowledged) ++owed[piece.message];
  });
  for (const MessageId id : path.jobs.messages()) owed[id] += path.jobs.find(id)->pieces();
  return owed;
}

// A message moves where another path brings all that this one still owes, in time. A part of it
// would be of no use, and in the way of what the other path carries itself. Rounds have a guard
// that counts on the links of their plans: what moves falsely costs them more than a stall does.
MoveOrder plan_move(const Traffic& traffic, TimePoint now, LinkId from, const OutgoingMessage& m,
                    std::size_t owed_pieces) {
  if (!m.rescue.empty()) {
    // It stays where it is, too: suspicion is often wrong, and this one has a way out for it.
    const auto last = last_departure(traffic, m, m.rescue, from, m.missing_ip_bytes(), m.deadline);
    return {last && last->at >= now ? std::optional(last->path) : std::nullopt, false};
  }
  if (m.kind != wire::MessageKind::kPlain) return {};
  const std::size_t bytes = owed_pieces * m.chunk;
  const bool fits = std::ranges::any_of(traffic.paths, [&](const auto& other) {
    const SendPath& path = other.second;
    return path.view.up && !path.view.suspect && m.repairs.contains(other.first) &&
           path.can_carry(m.chunk) &&
           now + path.view.air_time(path.jobs.bytes() + bytes) + path.view.one_way <= m.deadline;
  });
  return {std::nullopt, fits};
}

}  // namespace interneuron::flow
