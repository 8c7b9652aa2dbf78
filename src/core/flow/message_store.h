// The messages that a sender keeps until they are acknowledged or their time is over: their bytes,
// once, however many paths they go over, and what became of their fragments.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/id_map.h"
#include "core/flow/path_set.h"
#include "core/wire/message_bytes.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// The importance of messages that do not say otherwise (SendOptions::importance), and of rounds.
inline constexpr std::uint8_t kUsualImportance = 128;

// A message under way; a plain value of MessageStore's.
struct OutgoingMessage {
  MessageId id{};
  wire::MessageBytes bytes;
  TimePoint deadline{};
  // See Sender::Times.
  Duration doubt{};
  std::uint32_t lifetime_us = 0;
  std::uint8_t importance = kUsualImportance;
  wire::MessageKind kind{};
  std::uint16_t count = 0;
  std::uint16_t chunk = 0;
  std::uint16_t unacknowledged = 0;
  // No fragment from this one on has left yet.
  std::uint32_t sent = 0;
  // How many paths it was queued on.
  std::uint8_t paths = 0;
  // The paths over which lost fragments may be sent again.
  PathSet repairs;
  // What takes its place when it is given up (Sender::add_alternative()), and whether it may take
  // another's.
  std::optional<MessageId> alternative;
  bool is_alternative = false;
  struct PieceState {
    bool acknowledged = false;
    // Copies that are queued or in flight.
    std::uint8_t under_way = 0;
  };
  std::vector<PieceState> pieces;
};

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
  bool contains(MessageId id) const { return by_id_.find(id).has_value(); }

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
    message.id = id;
    message.deadline = deadline;
    message.count = message.unacknowledged = count;
    message.sent = 0;
    message.paths = paths;
    message.repairs = {};
    message.alternative.reset();
    message.is_alternative = false;
    message.pieces.assign(count, {false, paths});
    by_id_.insert(id, slot);
    deadlines_.set(slot, deadline);
    return message;
  }

  void erase(MessageId id) {
    const auto slot = by_id_.find(id);
    if (!slot) return;
    OutgoingMessage& message = slots_[*slot];
    message.bytes = {};
    if (message.count > kMostKept) message.pieces = {};
    deadlines_.remove(*slot);
    by_id_.erase(id);
    free_.push_back(*slot);
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
};

}  // namespace interneuron::flow
