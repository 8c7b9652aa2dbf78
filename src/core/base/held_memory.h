// What messages hold that are whole and wait for a better variant, or for those before them: how
// many each peer has, and how many bytes.
//
// One for each endpoint, whose rounds and plain messages tell it what they keep and ask it for
// room: a peer may have a limited number that wait, and of the memory for all of them only what
// leaves room for others (SharedMemory). Pure; thread-compatible.
#pragma once

#include <cstddef>
#include <map>

#include "core/base/shared_memory.h"
#include "interneuron/units.h"

namespace interneuron {

class HeldMemory {
 public:
  // What the messages of all peers may hold, in bytes: 16 of the largest half of a raw frame
  // (4 MB). No measurement behind this value.
  static constexpr std::size_t kBudgetBytes = std::size_t{64} * 1024 * 1024;

  // Whether one more message of so many bytes may wait where the peer may have `most` messages.
  bool has_room(PeerId peer, std::size_t bytes, std::size_t most) const {
    return count(peer) < most && bytes <= memory_.room(this->bytes(peer));
  }
  void add(PeerId peer, std::size_t bytes) {
    OfPeer& of = peers_[peer];
    memory_.change(of.bytes, of.bytes + bytes);
    of.bytes += bytes;
    ++of.messages;
  }
  // Requires that add() was told of it.
  void remove(PeerId peer, std::size_t bytes) {
    const auto of = peers_.find(peer);
    memory_.change(of->second.bytes, of->second.bytes - bytes);
    of->second.bytes -= bytes;
    if (--of->second.messages == 0) peers_.erase(of);
  }
  std::size_t count(PeerId peer) const {
    const auto of = peers_.find(peer);
    return of == peers_.end() ? 0 : of->second.messages;
  }
  std::size_t bytes(PeerId peer) const {
    const auto of = peers_.find(peer);
    return of == peers_.end() ? 0 : of->second.bytes;
  }

 private:
  struct OfPeer {
    std::size_t messages = 0;
    std::size_t bytes = 0;
  };
  std::map<PeerId, OfPeer> peers_;
  SharedMemory memory_{kBudgetBytes};
};

}  // namespace interneuron
