// What becomes of messages on a path that cannot be relied on any more.
#include <algorithm>
#include <map>
#include <vector>

#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kLong = std::chrono::hours(1);

}  // namespace

bool Sender::any_is_sound() const {
  return std::ranges::any_of(
      paths_, [](const auto& entry) { return entry.second.view.up && !entry.second.view.suspect; });
}

void Sender::pull(TimePoint now, LinkId link) {
  const auto it = paths_.find(link);
  if (it == paths_.end()) return;
  it->second.view.up = false;
  send_elsewhere(now, it->second, nullptr);
}

void Sender::doubt(TimePoint now, LinkId link) {
  const auto it = paths_.find(link);
  if (it == paths_.end()) return;
  it->second.view.suspect = true;
  // Else nothing is better than to wait for it.
  if (!any_is_sound()) return;
  const std::vector<MessageId> movable = fitting_elsewhere(now, it->second);
  send_elsewhere(now, it->second, &movable);
}

// The messages of which another path brings all that this one still owes, in time. A part of one
// would be of no use, and in the way of what the other path carries itself. Rounds have a guard
// that counts on the links of their plans: what moves falsely costs them more than a stall does.
std::vector<MessageId> Sender::fitting_elsewhere(TimePoint now, Path& path) {
  std::map<MessageId, std::size_t> owed;
  for (const auto& [piece, arrived, was_open] : path.sent.in_flight()) {
    const Message* message = messages_.find(piece.message);
    if (message != nullptr && !message->pieces[piece.index].acknowledged) ++owed[piece.message];
  }
  for (const MessageId id : path.jobs.messages()) owed[id] += path.jobs.find(id)->pieces();
  std::vector<MessageId> out;
  for (const auto& entry : owed) {
    Message& m = *messages_.find(entry.first);
    if (!m.rescue.empty()) {
      // It stays where it is, too: suspicion is often wrong, and this one has a way out for it.
      const auto chance = last_chance(m, m.rescue, &path, missing_bytes(m), m.deadline);
      if (chance && chance->arrival >= now) rescue(now, *chance->path, m);
      continue;
    }
    if (m.kind != wire::MessageKind::kPlain) continue;
    const std::size_t bytes = entry.second * m.chunk;
    const bool fits = std::ranges::any_of(paths_, [&](const auto& other) {
      const Path& p = other.second;
      const DataRate rate = p.view.rate.value_or(kBlindRate);
      return p.view.up && !p.view.suspect && m.repairs.contains(other.first) &&
             p.max_datagram >= m.chunk + kPieceOverheadBytes &&
             now + std::min<Duration>(rate.transmit_time(p.jobs.bytes() + bytes), kLong) +
                     p.view.one_way <=
                 m.deadline;
    });
    if (fits) out.push_back(entry.first);
  }
  return out;
}

// What is queued or in flight on a path that repairs nothing goes over the others, as far as they
// bring it in time: of all messages, or of these only.
void Sender::send_elsewhere(TimePoint now, Path& path, const std::vector<MessageId>* only) {
  const auto moves = [only](MessageId id) {
    return only == nullptr || std::ranges::find(*only, id) != only->end();
  };
  // What is in flight is queued again but not settled as lost: it may have arrived, and then its
  // acknowledgement saves the second copy.
  for (const auto& [piece, arrived, was_open] : path.sent.in_flight()) {
    const Message* message = messages_.find(piece.message);
    if (message == nullptr || !moves(piece.message)) continue;
    if (!message->pieces[piece.index].acknowledged) repair(now, piece.message, piece.index);
    touch(*message);
  }
  for (const MessageId id : path.jobs.messages()) {
    if (!moves(id)) continue;
    Message& message = *messages_.find(id);
    // No other job is added to this path meanwhile, because nothing is repaired over it.
    Job& job = *path.jobs.find(id);
    message.firsts_gone(job.firsts());
    for (const std::uint16_t index : path.jobs.take_all(job)) {
      message.copy_gone(index);
      if (message.pieces[index].acknowledged || repair(now, id, index)) continue;
      // No other path brings it in time: it waits here for this path to come back.
      message.copy_added(index);
      path.jobs.push_again(job, index);
    }
    touch(message);
  }
  protect_touched(now);
}

}  // namespace interneuron::flow
