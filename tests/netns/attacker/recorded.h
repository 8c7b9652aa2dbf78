// What an attacker on the way has recorded of honest hosts: packets that come in over a NIC, and
// those of a capture that was made before.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "interneuron/units.h"
#include "node/io/file_descriptor.h"
#include "tests/netns/attacker/confined.h"

namespace interneuron::attacker {

struct Recorded {
  Place from;
  Place to;
  TimePoint at{};
  Bytes payload;
};

// The UDP packets of a capture of Ethernet frames, as tcpdump writes it on this host. Throws
// std::runtime_error that names the file.
std::vector<Recorded> read_capture(const std::string& file);

// Needs CAP_NET_RAW. One thread.
class Recorder {
 public:
  // Records what comes in over this NIC. Throws std::runtime_error.
  explicit Recorder(const std::string& nic);

  // Takes what has come since the last call.
  void turn(TimePoint now);
  // The newest packet; nullptr: none has come.
  const Recorded* newest() const;
  // Any sealed packet that has reached its receiver by now; nullptr: there is none.
  const Recorded* any(TimePoint now, std::mt19937_64& random) const;
  // The recorded packets of handshakes.
  const std::vector<Recorded>& handshakes() const { return handshakes_; }

 private:
  io::FileDescriptor socket_;
  // A ring.
  std::vector<Recorded> packets_;
  std::size_t next_ = 0;
  std::vector<Recorded> handshakes_;
};

}  // namespace interneuron::attacker
