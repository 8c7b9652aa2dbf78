// What becomes of a message that its path gives up: nothing more of it is sent there, and a smaller
// variant may take its place.
#include <utility>

#include "core/flow/sender.h"

namespace interneuron::flow {

MessageId Sender::add_alternative(MessageId first, wire::MessageBytes bytes) {
  const MessageId id{next_message_++};
  Message* other = messages_.find(first);
  if (other == nullptr || bytes.empty()) return id;
  const std::size_t count = (bytes.size() + other->chunk - 1) / other->chunk;
  if (count > UINT16_MAX) return id;
  if (other->paths > 1) return id;
  other->alternative = id;
  Message& m = messages_.add(id, other->deadline, static_cast<std::uint16_t>(count), 0);
  // add() may have moved it.
  other = messages_.find(first);
  m.chunk = other->chunk;
  m.doubt = other->doubt;
  m.importance = other->importance;
  m.lifetime_us = other->lifetime_us;
  m.repairs = other->repairs;
  m.kind = other->kind;
  m.bytes = std::move(bytes);
  bytes_ += m.bytes.size();
  m.is_alternative = true;
  return id;
}

std::optional<Duration> Sender::least_time(LinkId link, std::size_t ip_bytes) const {
  const auto it = paths_.find(link);
  if (it == paths_.end() || !it->second.view.loaded) return std::nullopt;
  const Path& path = it->second;
  return flow::least_time(path.view, ip_bytes, path.sent.bytes_in_flight(), false);
}

void Sender::give_up(Path& path, Job& job) {
  const MessageId id = job.message;
  Message& message = *messages_.find(id);
  job.for_each([this, &message](std::uint16_t index) {
    Message::PieceState& piece = message.pieces[index];
    if (piece.under_way > 0) --piece.under_way;
    if (!piece.acknowledged) ++cancelled_;
  });
  const bool all_left = job.next >= job.count;
  path.jobs.remove(id);
  // Where all of it has left, what was to be sent again may be there after all.
  if (message.paths > 1 || all_left) return;
  // Nobody else completes it, so nothing of it is sent again.
  if (message.kind == wire::MessageKind::kPlain) given_up_.push_back(id);
  const auto alternative = message.alternative;
  bytes_ -= message.bytes.size();
  parting_.push_back(std::exchange(message.bytes, {}).payload);
  forget(id);
  Message* next = alternative ? messages_.find(*alternative) : nullptr;
  if (next == nullptr) return;
  next->paths = 1;
  for (Message::PieceState& piece : next->pieces) piece.under_way = 1;
  path.jobs.add(next->id, turn_of(path, next->deadline, next->importance), 0, next->count,
                next->chunk);
}

}  // namespace interneuron::flow
