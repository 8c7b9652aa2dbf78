// Answers echoes (docs/wire_format.md): a stateful Session-Reflector of RFC 8762 §4.3 inside our
// packets. Every request gets one reply of its size over the path it came by: at once, after the
// delay it asks for or, in a held train, back to back with the others. Nothing is amplified, and a
// forged sender address reaches nobody with more than was sent. Whoever asks becomes no peer.
// Memory is bounded. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron {

class EchoReflector {
 public:
  // Whose requests are counted; beyond, the one that was silent for longest is forgotten. Chosen: 8
  // vehicles with 8 NICs.
  static constexpr std::size_t kMaxPaths = 64;
  // Trains that wait for their last request; others are answered at once. Chosen.
  static constexpr std::size_t kMaxHeldTrains = 8;
  // Replies that wait, held or on their way out; further requests are dropped. Four of the longest
  // trains; chosen.
  static constexpr std::size_t kMaxWaiting = 4 * wire::kMaxEchoTrain;
  // Replies that wait for the delay they were asked for, beside those above; others are sent at
  // once. Chosen: 8 silences with 2 flows each over 4 NICs.
  static constexpr std::size_t kMaxDelayed = 64;
  // A held train leaves this long after its newest request (at 1 Mbit/s one takes 11 ms) and at the
  // latest so long after its first. Chosen.
  static constexpr Duration kHold = std::chrono::milliseconds(100);
  static constexpr Duration kHoldAtMost = std::chrono::milliseconds(500);

  explicit EchoReflector(SessionId self) : self_(self) {}

  // `packet`: an echo that came in as `datagram`. False: it is no request, or there is no room.
  bool take(TimePoint now, const wire::Packet& packet, const Datagram& datagram);
  void remove_link(LinkId nic);

  std::optional<TimePoint> next_timeout() const;
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer);
  std::size_t waiting() const;

 private:
  struct Reply {
    LinkId nic{};
    Address to{};
    LinkId link{};  // as the prober names the path
    wire::Echo echo;
    std::size_t size = 0;
  };
  struct Path {
    LinkId nic{};
    Address from{};
    SessionId session{};
    LinkId link{};
    std::uint32_t requests = 0;  // that have arrived
    TimePoint heard{};
    // The train that is held, in the order of arrival.
    std::uint16_t train = 0;
    TimePoint train_began{};
    std::vector<Reply> held;
  };
  Path& path_of(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  bool may_hold(const Path& path) const;
  void release(Path& path);
  void release_due(TimePoint now);
  static TimePoint release_at(const Path& path);

  SessionId self_;
  std::vector<Path> paths_;
  std::multimap<TimePoint, Reply> delayed_;  // by when they leave
  std::deque<Reply> ready_;
};

}  // namespace interneuron
