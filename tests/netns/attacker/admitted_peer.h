// A peer that a roadside unit admits and keeps, and that then does as it likes: it says what an
// Endpoint says to join (feedback, and the answer to a challenge), goes on with feedback that
// acknowledges what comes, and beside that sends whatever it is given, at no more than a rate.
//
// With keys it is a host that the road trusts: it makes a handshake first and seals all that it
// sends, whatever that is.
//
// It is written by hand instead of with an Endpoint, because no Endpoint would send what it sends.
// One path. Belongs to one thread; the socket is another's.
#pragma once

#include <bitset>
#include <cstdint>
#include <deque>
#include <memory>
#include <random>

#include "core/wire/packet.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"
#include "tests/netns/attacker/sealed_channel.h"

namespace interneuron::attacker {

// The answer to a challenge: a packet of type 7 whose body is our session (4 bytes) and a token (16
// bytes) is answered by one of type 8 with that token (docs/wire_format.md). Returns its size, 0
// where `challenge` is none or names another session. The buffer must hold kMaxDatagramBytes.
std::size_t answer_challenge(ByteView challenge, SessionId self, std::uint64_t number,
                             std::span<std::byte> out);
// The session that a packet names as its sender's; 0 of what is no packet.
std::uint32_t sender_of(ByteView packet);
// The session that a challenge was meant for; 0 of anything else.
std::uint32_t challenged(ByteView packet);
// A feedback packet as a new peer sends it, without reports. `echo`: 0 or the other side's session.
Bytes hello(const wire::PacketHeader& header, std::int64_t u, std::uint32_t echo);

class AdmittedPeer {
 public:
  // `socket` is connected and does not block. `bits_per_second` bounds what is sent, IP headers
  // included. `keys`: nullptr: in the clear.
  AdmittedPeer(int socket, double bits_per_second, TimePoint now, std::mt19937_64& random,
               const Keys* keys = nullptr);

  // Reads what has come, says what is due, and sends of what waits as much as the rate allows.
  void turn(TimePoint now);
  // The other side has heard us and told so: we are a peer.
  bool joined() const { return joined_; }
  // Nothing waits to be sent.
  bool idle() const { return queue_.empty(); }
  SessionId session() const { return session_; }
  // The other side's; 0 before it has been heard.
  std::uint32_t echo() const { return echo_; }
  std::uint64_t next_number() { return ++number_; }
  // The packet that answered the newest challenge, in the clear; empty where none came.
  ByteView token() const { return token_; }
  // What it seals with; nullptr: nothing.
  std::shared_ptr<SealedChannel> channel() const { return channel_; }

  // Cuts a message into data packets, which wait to be sent.
  void send_message(ByteView message, std::uint32_t lifetime_us);
  // A single piece of a message that is said to have `size` bytes.
  void send_piece(std::uint32_t size, std::uint16_t chunk, std::uint16_t index, ByteView bytes,
                  std::uint32_t lifetime_us);
  // Any packet; its number is filled in when it leaves, unless it has `own_number`.
  void send_packet(Bytes packet, bool own_number = false);
  // For packets that are made elsewhere.
  wire::PacketHeader header(wire::PacketType type, TimePoint now) const;

  struct Counters {
    std::uint64_t sent_packets = 0;
    // With IP and UDP headers.
    std::uint64_t sent_bytes = 0;
    std::uint64_t received_packets = 0;
    std::uint64_t challenges = 0;
    // Data packets that came: results.
    std::uint64_t results = 0;
  };
  const Counters& counters() const { return counters_; }

 private:
  struct Waiting {
    Bytes packet;
    bool own_number = false;
  };
  void receive(TimePoint now);
  void take(TimePoint now, ByteView packet);
  void take_sealed(TimePoint now, ByteView packet);
  void take_opened(TimePoint now, const wire::Packet& packet);
  void show(const wire::Token& token);
  void note_number(std::uint64_t number);
  void say(TimePoint now);
  void flush(TimePoint now);
  void send_now(ByteView packet);
  void send_bytes(ByteView packet);

  int socket_;
  double bytes_per_second_;
  double allowance_ = 0;
  TimePoint began_;
  TimePoint refilled_;
  TimePoint say_at_;
  SessionId session_;
  std::uint64_t number_;
  std::uint32_t message_ = 0;
  Bytes token_;
  std::deque<Waiting> queue_;
  std::shared_ptr<SealedChannel> channel_;

  bool joined_ = false;
  std::uint32_t echo_ = 0;
  // The newest `u` of the other side and when it came.
  std::int64_t newest_u_ = 0;
  TimePoint newest_at_{};
  // The largest number that came, and which of those before it.
  std::uint64_t largest_ = 0;
  std::bitset<wire::kAckWindow> before_;
  Counters counters_;
};

}  // namespace interneuron::attacker
