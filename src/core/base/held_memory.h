// What messages hold that are whole and wait for a better variant, or for those before them: how
// many each peer has, and how many bytes.
//
// One for each endpoint, whose rounds and plain messages tell it what they keep and ask it for
// room: a peer may have a limited number that wait, and of the memory for all of them only what
// leaves room for others (SharedMemory). Pure; thread-compatible.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>

#include "core/base/shared_memory.h"
#include "interneuron/shard.h"
#include "interneuron/units.h"

namespace interneuron {

class HeldMemory {
 public:
  // What the messages of all peers may hold, in bytes: 16 of the largest half of a raw frame
  // (4 MB). No measurement behind this value.
  static constexpr std::size_t kBudgetBytes = std::size_t{64} * 1024 * 1024;

  explicit HeldMemory(const Shard& shard = {})
      : holdings_(shard.holdings),
        memory_(kBudgetBytes, holdings_ ? &holdings_->held_bytes : nullptr) {}

  // What a message waits for: a better variant, or those before it.
  enum class For : std::uint8_t { kVariant, kOrder };

  // Whether one more message of so many bytes may wait where the peer may have `most` that wait for
  // the same.
  bool has_room(PeerId peer, std::size_t bytes, std::size_t most, For what = For::kVariant) const {
    const auto of = peers_.find(peer);
    const std::size_t waiting = of == peers_.end() ? 0 : of->second.messages[at(what)];
    return waiting < most && bytes <= memory_.room(this->bytes(peer));
  }
  void add(PeerId peer, std::size_t bytes, For what = For::kVariant) {
    OfPeer& of = peers_[peer];
    memory_.change(of.bytes, of.bytes + bytes);
    of.bytes += bytes;
    ++of.messages[at(what)];
  }
  // Requires that add() was told of it.
  void remove(PeerId peer, std::size_t bytes, For what = For::kVariant) {
    const auto of = peers_.find(peer);
    memory_.change(of->second.bytes, of->second.bytes - bytes);
    of->second.bytes -= bytes;
    --of->second.messages[at(what)];
    if (of->second.count() == 0) peers_.erase(of);
  }
  std::size_t count(PeerId peer) const {
    const auto of = peers_.find(peer);
    return of == peers_.end() ? 0 : of->second.count();
  }
  std::size_t bytes(PeerId peer) const {
    const auto of = peers_.find(peer);
    return of == peers_.end() ? 0 : of->second.bytes;
  }

 private:
  static std::size_t at(For what) { return static_cast<std::size_t>(what); }
  struct OfPeer {
    std::array<std::size_t, 2> messages{};
    std::size_t bytes = 0;
    std::size_t count() const { return messages[0] + messages[1]; }
  };
  std::map<PeerId, OfPeer> peers_;
  std::shared_ptr<SharedHoldings> holdings_;
  SharedMemory memory_;
};

}  // namespace interneuron
