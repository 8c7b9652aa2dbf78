// The messages that a sender keeps until they are acknowledged or their time is over.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/id_map.h"
#include "core/flow/outgoing_message.h"

namespace interneuron::flow {

// Sender owns one. A message is found in O(1), added and erased in O(log n), and so is the one
// whose deadline is next. Memory grows with the largest number of messages at a time and is used
// again, but for the messages' own bytes. References are valid until the next add(). Pure;
// thread-compatible.
class MessageStore {
 public:
  OutgoingMessage* find(MessageId id) {
    const auto slot = by_id_.find(id);
    return slot ? &slots_[*slot] : nullptr;
  }
  const OutgoingMessage* find(MessageId id) const {
    return const_cast<MessageStore*>(this)->find(id);
  }

  // A new message of so many fragments, each queued on so many paths; the rest of it is for the
  // caller to fill in.
  OutgoingMessage& add(MessageId id, TimePoint deadline, std::uint16_t count, std::uint8_t paths) {
    if (free_.empty()) {
      free_.push_back(static_cast<std::uint32_t>(slots_.size()));
      slots_.emplace_back();
    }
    const std::uint32_t slot = free_.back();
    free_.pop_back();
    OutgoingMessage& message = slots_[slot];
    // Nothing stays of the message that had the place before, but for the memory of its lists.
    OutgoingMessage fresh;
    fresh.shares = std::move(message.shares);
    fresh.pieces = std::move(message.pieces);
    fresh.symbols = std::move(message.symbols);
    fresh.blocks = std::move(message.blocks);
    message = std::move(fresh);
    message.shares.clear();
    message.symbols.clear();
    message.id = id;
    message.deadline = deadline;
    message.count = message.unacknowledged = count;
    message.paths = paths;
    message.pieces.assign(count, {false, false, false, paths});
    message.blocks.assign(message.division().blocks(), {});
    for (std::size_t b = 0; paths > 0 && b < message.blocks.size(); ++b) {
      message.blocks[b].under_way = static_cast<std::uint16_t>(message.division().pieces(b));
    }
    by_id_.insert(id, slot);
    deadlines_.set(slot, deadline);
    return message;
  }

  void erase(MessageId id) {
    const auto slot = by_id_.find(id);
    if (!slot) return;
    OutgoingMessage& message = slots_[*slot];
    message.bytes = {};
    message.symbols.clear();
    if (message.count > kMostKept) {
      // Not {}, which a vector takes for an empty list of values, and keeps its memory.
      message.pieces = std::vector<OutgoingMessage::PieceState>();
      message.symbols = std::vector<Bytes>();
      message.blocks = std::vector<OutgoingMessage::Block>();
    }
    deadlines_.remove(*slot);
    looks_.remove(*slot);
    by_id_.erase(id);
    free_.push_back(*slot);
  }

  // When a message is to be looked at, whatever for; nothing: not at all.
  void look_at(MessageId id, std::optional<TimePoint> when) {
    const auto slot = by_id_.find(id);
    if (!slot) return;
    if (when) {
      looks_.set(*slot, *when);
    } else {
      looks_.remove(*slot);
    }
  }
  std::optional<TimePoint> next_look() const { return looks_.earliest(); }
  std::optional<MessageId> look_due(TimePoint now) const {
    const auto slot = looks_.due(now);
    return slot ? std::optional(slots_[*slot].id) : std::nullopt;
  }

  std::optional<TimePoint> next_deadline() const { return deadlines_.earliest(); }
  // A message whose deadline is at or before `now`.
  std::optional<MessageId> due(TimePoint now) const {
    const auto slot = deadlines_.due(now);
    return slot ? std::optional(slots_[*slot].id) : std::nullopt;
  }
  void clear() { *this = {}; }

 private:
  // Fragments for which a free place keeps its memory: those of a message of 1.4 MB. No measurement
  // behind this value: it only has to be more than common messages have.
  static constexpr std::uint16_t kMostKept = 1024;

  std::vector<OutgoingMessage> slots_;
  std::vector<std::uint32_t> free_;
  IdMap<MessageId> by_id_;
  Alarms deadlines_;
  Alarms looks_;
};

}  // namespace interneuron::flow
