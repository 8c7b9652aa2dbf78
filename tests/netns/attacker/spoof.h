// UDP over IPv4 from any address: what an attacker sends whose network does not look at sources.
// Needs CAP_NET_RAW. Checksums of UDP are left out, as IPv4 allows. One thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "interneuron/units.h"
#include "node/io/file_descriptor.h"
#include "tests/netns/attacker/confined.h"

namespace interneuron::attacker {

class SpoofSocket {
 public:
  // Sends over this NIC alone. Throws std::runtime_error.
  explicit SpoofSocket(const std::string& nic);
  // Waits for flush(), which is called where there are kBatch of them.
  void add(Place from, Place to, ByteView payload);
  void flush();

  std::uint64_t packets() const { return packets_; }
  // With IP and UDP headers.
  std::uint64_t bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kBatch = 64;
  struct Datagram {
    std::uint32_t to = 0;
    Bytes bytes;
  };
  io::FileDescriptor socket_;
  std::vector<Datagram> batch_;
  std::uint64_t packets_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace interneuron::attacker
