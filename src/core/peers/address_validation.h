// Proves that whoever asks receives what is sent to the address that it asks from, before anything
// is remembered or sent for that address (RFC 9000 §8.1; the idea is that of SYN cookies, RFC 4987
// §3.6).
//
// A packet from an address that is not proved is answered with a challenge: one packet, less than
// three times as large as the smallest that asks, with a token. A token is a keyed hash
// (SipHash-2-4 with 128 bits, of libsodium) of the path, the NIC, the address, the session and the
// time, so that it can be checked without having been kept. Who sends the token back from there
// does receive what is sent there. Tokens hold for kEpoch to twice that.
//
// Owned and fed by Gate. Anybody may ask from forged addresses: the challenges are then lost, and
// of those that wait or would leave at more than kPerSecond the newest are dropped, so that memory
// and the load of the link are bounded. Who asks without forging is asked again when its challenge
// was dropped, since a peer that is not answered goes on asking. A token that was overheard is good
// only for the address that it was made for. Constant memory. Pure; thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/ring.h"
#include "core/wire/packet.h"
#include "interneuron/endpoint.h"

namespace interneuron::peers {

class AddressValidation {
 public:
  // How long a token holds at least. It has to outlive one round trip of the slowest link; no
  // measurement behind this value beyond that.
  static constexpr Duration kEpoch = std::chrono::seconds(5);
  // Challenges that leave in one second: 13 Mbit/s with their headers. A vehicle that joins asks
  // about 16 times a second over each of its links (link::ProbeSchedule::kNewHeartbeat), so that
  // beside 50,000 forged packets a second it has a challenge within a few tenths.
  static constexpr double kPerSecond = 20'000;
  // Challenges that may leave at once and wait for the next poll(): those of a tenth of a second,
  // as of cookies (crypto::Responder::kMaxWaiting), since vehicles that come together also ask
  // together: what did not leave in a burst is asked for again a sixteenth of a second later. At
  // most 0.2 MB.
  static constexpr std::size_t kMaxWaiting = 2000;

  // `self`: our session. `secret`: random, told to nobody.
  AddressValidation(SessionId self, const Secret& secret) : self_(self), secret_(secret) {}

  // Queues a challenge for whoever sent this packet. False where none may leave now.
  bool challenge(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram);
  // What whoever sent this packet has to show.
  wire::Token token(TimePoint now, const wire::PacketHeader& header,
                    const Datagram& datagram) const;
  // Whether this token, which the packet carries, was made here for its path, address and session,
  // and still holds.
  bool proves(TimePoint now, const wire::PacketHeader& header, const Datagram& datagram,
              const wire::Token& token) const;
  // Challenges that would leave over this NIC are dropped.
  void remove_link(LinkId nic);

  // To whom: the session of the packet that is answered.
  struct Leaving : Transmit {
    SessionId session{};
  };
  // Writes the next challenge into `buffer`.
  std::optional<Leaving> poll(std::span<std::byte> buffer);

 private:
  struct Waiting {
    LinkId nic{};
    Address to{};
    wire::PacketHeader header;
    wire::Challenge challenge;
  };
  wire::Token token_of(std::int64_t epoch, const wire::PacketHeader& header,
                       const Datagram& datagram) const;

  SessionId self_;
  Secret secret_;
  Ring<Waiting> waiting_;
  // How many challenges may leave, as of refilled_at_.
  double credit_ = kMaxWaiting;
  TimePoint refilled_at_ = TimePoint::min();
};

// What addresses of one network have in common: the first 16 bits of an IPv4 address, the first 48
// of an IPv6 address, which is what one customer of a network is given at most. Of what is
// neither it is all bytes.
using Network = std::array<std::byte, 18>;
Network network_of(const Address& address);
// All of the address but its port.
Network host_of(const Address& address);

}  // namespace interneuron::peers
