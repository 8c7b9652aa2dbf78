// What a program spends on its messages: processor time, and IP bytes that leave its host.
#pragma once

#include <cstdint>

#include "interneuron/time.h"

namespace interneuron::transports {

// User and system time of all threads of this process so far. The kernel's own work on packets
// counts where it is done in a system call of the process, as sending is.
Duration processor_time();

// All that this process and this host have spent since the Outlay was made. Bytes are those of all
// NICs of the host's network namespace but loopback, by the kernel's counters without the headers
// of Ethernet: whatever a transport sends counts, be it data, repairs, probes or feedback. Throws
// Failure (1) when the counters cannot be read. Thread-compatible.
class Outlay {
 public:
  Outlay();
  Duration cpu() const { return processor_time() - cpu_; }
  std::uint64_t wire_bytes() const;

 private:
  Duration cpu_;
  std::uint64_t sent_;
};

}  // namespace interneuron::transports
