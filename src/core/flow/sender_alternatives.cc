// What becomes of a message that its path gives up: nothing more of it is sent there, and a smaller
// variant may take its place.
#include <algorithm>
#include <utility>

#include "core/flow/sender.h"

namespace interneuron::flow {

MessageId Sender::add_alternative(TimePoint now, MessageId first, wire::MessageBytes bytes,
                                  const PathSet& rescue) {
  const MessageId id{next_message_++};
  Message* other = messages_.find(first);
  if (other == nullptr || bytes.empty()) return id;
  const std::size_t count = (bytes.size() + other->chunk - 1) / other->chunk;
  if (count > UINT16_MAX) return id;
  if (other->paths > 1 && rescue.empty()) return id;
  other->alternative = id;
  Message& m = messages_.add(id, other->deadline, static_cast<std::uint16_t>(count), 0);
  // add() may have moved it.
  other = messages_.find(first);
  m.chunk = other->chunk;
  m.aim = other->aim;
  m.doubt = other->doubt;
  m.importance = other->importance;
  m.lifetime_us = other->lifetime_us;
  m.repairs = other->repairs;
  m.take(std::move(bytes), other->kind);
  bytes_ += m.bytes.size();
  m.is_alternative = true;
  m.rescue = rescue;
  plan_rescue(now, *other);
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
    message.copy_gone(index);
    if (!message.pieces[index].acknowledged) ++cancelled_;
  });
  const bool all_left = job.next >= job.count;
  message.firsts_gone(job.firsts());
  path.jobs.remove(id);
  // Where all of it has left, what was to be sent again may be there after all.
  if (message.paths > 1 || all_left || !message.is_surely_incomplete()) return;
  // What another path has of it may complete it.
  const bool waits_elsewhere = std::ranges::any_of(paths_, [id](const auto& entry) {
    const Job* other = entry.second.jobs.find(id);
    return other != nullptr && other->pieces() > 0;
  });
  if (waits_elsewhere) return;
  // Nobody else completes it, so nothing of it is sent again.
  if (message.kind == wire::MessageKind::kPlain) given_up_.push_back(id);
  const auto alternative = std::exchange(message.alternative, std::nullopt);
  bytes_ -= message.held();
  parting_.push_back(std::exchange(message.bytes, {}).payload);
  for (Bytes& symbol : std::exchange(message.symbols, {})) parting_.push_back(std::move(symbol));
  forget(id);
  Message* next = alternative ? messages_.find(*alternative) : nullptr;
  if (next == nullptr) return;
  begin_alternative(path, *next);
}

// An alternative sets out over this path.
void Sender::begin_alternative(Path& path, Message& m) {
  m.paths = 1;
  for (std::uint16_t i = 0; i < m.count; ++i) m.copy_added(i);
  m.taken = {};
  for (const auto& [link, other] : paths_) {
    if (&other == &path) m.taken.add(link);
  }
  m.to_leave = m.count;
  path.jobs.add(m.id, turn_of(path, m.deadline, m.importance), 0, m.count, m.chunk);
}

}  // namespace interneuron::flow
