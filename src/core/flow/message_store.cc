// MessageStore: how a message takes a place among those under way, and leaves it.
#include <utility>

#include "core/flow/traffic.h"

namespace interneuron::flow {
namespace {

// Fragments for which a free place keeps its memory: those of a message of 1.4 MB. No measurement
// behind this value: it only has to be more than common messages have.
constexpr std::uint16_t kMostPiecesKept = 1024;

}  // namespace

OutgoingMessage& MessageStore::add(MessageId id, TimePoint deadline, std::uint16_t count,
                                   std::uint8_t paths) {
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

void MessageStore::erase(MessageId id) {
  const auto slot = by_id_.find(id);
  if (!slot) return;
  OutgoingMessage& message = slots_[*slot];
  message.bytes = {};
  message.symbols.clear();
  if (message.count > kMostPiecesKept) {
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

void MessageStore::look_at(MessageId id, std::optional<TimePoint> when) {
  const auto slot = by_id_.find(id);
  if (!slot) return;
  if (when) {
    looks_.set(*slot, *when);
  } else {
    looks_.remove(*slot);
  }
}

}  // namespace interneuron::flow
