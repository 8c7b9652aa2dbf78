// A NIC's UDP socket that says of each datagram when the kernel received it and with which TTL: for
// measuring, where it matters more than throughput. See UdpTransport for the opposite.
//
// Received bytes and addresses are a stranger's and may be forged; the time is the kernel's own,
// the TTL what the packet says. Buffer: 64 KiB, so that no datagram is cut off. Owns its socket.
// Set-up failures throw IoError. Thread-compatible.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "node/io/udp_socket.h"

namespace interneuron::io {

class StampedSocket {
 public:
  explicit StampedSocket(const UdpOptions& options);

  struct Received {
    Address from{};
    // The local address that it was sent to, port 0. Only with UdpOptions::answer_from_receiver on
    // a socket that is bound to no address; else of size 0.
    Address to{};
    // Valid until the next call.
    ByteView bytes;
    // When the kernel had it; the time of the call, where the kernel does not tell.
    TimePoint at{};
    // TTL or hop limit; 0 where the kernel does not tell.
    std::uint8_t ttl = 0;
  };
  // Nothing when nothing is there. Never blocks, never throws.
  std::optional<Received> receive();
  // Returns 0, or the errno; waits at most 10 ms for room in the socket's buffer. `source`: the
  // local address to send from, as Received::to tells it; of size 0: the kernel chooses. On a host
  // with several NICs that choice decides which routes count, so whoever answers should name the
  // address that was asked.
  int send(const Address& to, ByteView bytes, const Address& source = {});

  Address local_address() const { return socket_.local; }
  int native_handle() const { return socket_.fd.get(); }

 private:
  UdpSocket socket_;
  std::array<std::byte, 65536> buffer_;
};

}  // namespace interneuron::io
