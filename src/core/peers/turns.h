// Whose turn it is to send: of the peers that may have something to send now, which comes next.
//
// Two kinds of turns, because packets that report and keep alive are few, small and urgent: they
// come before all data, in the order in which peers were added. Data takes turns packet by packet
// over the NICs, and on each NIC over the peers by deficit round robin (RFC 8290 §4.2, after
// "Efficient Fair Queuing Using Deficit Round-Robin", Shreedhar and Varghese): a peer sends until
// it has used up kQuantum bytes and then waits behind the others. So no peer with a large queue
// starves another, and no NIC waits for one of a lower number.
//
// Peers are known by small dense numbers, as in Alarms. Owned and fed by Peers, which adds a peer
// when something has happened to it, sends what it has, and says when it has nothing more. A peer
// whose pace forbids sending has nothing now: it leaves, and its alarm brings it back. Constant
// time per call, except forget(). Pure; thread-compatible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/ring.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"

namespace interneuron::peers {

class Turns {
 public:
  using Slot = std::uint32_t;
  // Bytes that a peer sends over a NIC before the next peer's turn: one full packet, the quantum
  // that RFC 8290 §5.2.4 takes.
  static constexpr std::int64_t kQuantum = kMaxPacketBytes;

  // The peer may have feedback to send; no effect if it waits for that already.
  void add(Slot peer);
  // Whose feedback is next; the same until feedback_done().
  std::optional<Slot> feedback() const;
  void feedback_done();

  // The peer may have data to send over this NIC; no effect if it waits for that already.
  void add(Slot peer, LinkId nic);
  struct Turn {
    Slot peer = 0;
    LinkId nic{};
  };
  // Whose data is next; the same until sent() or done().
  std::optional<Turn> data();
  // The peer whose turn it was has sent a packet of this size, IP headers included.
  void sent(std::size_t ip_bytes);
  // It has nothing more to send over that NIC now.
  void done();

  // The peer is gone; its number may be used again. Time grows with the peers that wait.
  void forget(Slot peer);

 private:
  // What a peer may still send over a NIC in this turn, in bytes; below zero after a packet that
  // was larger than the rest.
  struct Account {
    std::int64_t credit = 0;
    bool waits = false;
  };
  struct Nic {
    LinkId id{};
    Ring<Slot> waiting;
    // By peer.
    std::vector<Account> accounts;
  };
  Nic& nic(LinkId id);
  void advance();

  Ring<Slot> feedback_;
  // By peer: whether it is in feedback_.
  std::vector<bool> waits_for_feedback_;
  // In the order in which they were first used; few.
  std::vector<Nic> nics_;
  // The place of the NIC whose turn it is.
  std::size_t turn_ = 0;
};

}  // namespace interneuron::peers
