// Writes what this process sends and receives over UDP into a capture file, on all NICs, also those
// that come later: libpcap's device "any" with link type LINUX_SLL2, which says of each packet
// which NIC it used (sll.ifindex) and in which direction, with stamps in nanoseconds. A kernel
// filter passes only the ports of this process's nodes and follows new ones before their first
// packet. Needs the part interneuron::pcap of the library.
//
// What one should know: a batch that leaves as one segmented send (UDP_SEGMENT) is seen as one
// large packet where the NIC does the cutting; and when a port is added, packets of the others may
// be missed for some microseconds.
//
// Needs CAP_NET_RAW in this network namespace. A thread of its own; it takes no signals.
// Thread-compatible. Errors throw IoError: EPERM with the command that helps.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace interneuron {

class PcapTap {
 public:
  explicit PcapTap(const std::string& file);
  // Calls stop().
  ~PcapTap();
  PcapTap(const PcapTap&) = delete;
  PcapTap& operator=(const PcapTap&) = delete;

  struct Counters {
    struct Nic {
      // "#7" when the NIC with that index is gone.
      std::string name;
      int index = 0;
      std::uint64_t packets = 0;
    };
    std::vector<Nic> nics;
    // Packets written.
    std::uint64_t packets = 0;
    // Packets that the kernel dropped because we read too slowly.
    std::uint64_t dropped = 0;
    // Why packets are missing at the end of the file; empty when none are.
    std::string problem;
  };
  // Waits for what is on its way, writes it out and closes the file. Harmless when repeated.
  Counters stop();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
