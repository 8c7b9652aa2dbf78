// A NIC's UDP socket that says of each datagram when the kernel received it and with which TTL: for
// measuring, where it matters more than throughput. See UdpTransport for the opposite.
//
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
    ByteView bytes;        // valid until the next call
    TimePoint at{};        // when the kernel had it; now, where it does not tell
    std::uint8_t ttl = 0;  // TTL or hop limit; 0: not told
  };
  // Nothing when nothing is there. Never blocks, never throws.
  std::optional<Received> receive();
  // 0, or the errno; waits at most 10 ms for room in the socket's buffer.
  int send(const Address& to, ByteView bytes);

  Address local_address() const { return socket_.local; }
  int native_handle() const { return socket_.fd.get(); }

 private:
  UdpSocket socket_;
  std::array<std::byte, 65536> buffer_;
};

}  // namespace interneuron::io
