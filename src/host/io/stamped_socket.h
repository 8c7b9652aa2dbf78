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

#include "host/io/udp_socket.h"

namespace interneuron::io {

class StampedSocket {
 public:
  explicit StampedSocket(const UdpOptions& options);

  struct Received {
    Address from{};
    // Valid until the next call.
    ByteView bytes;
    // When the kernel had it; the time of the call where the kernel does not tell.
    TimePoint at{};
    // TTL (IPv4) or hop limit (IPv6); 0 where the kernel does not tell.
    std::uint8_t ttl = 0;
  };
  // Nothing when nothing is there. Never blocks, never throws.
  std::optional<Received> receive();
  // Sends one datagram: 0, or the errno. Waits at most 10 ms for room in the socket's buffer.
  int send(const Address& to, ByteView bytes);

  Address local_address() const { return socket_.local; }
  int native_handle() const { return socket_.fd.get(); }

 private:
  UdpSocket socket_;
  std::array<std::byte, 65536> buffer_;
};

}  // namespace interneuron::io
