// The XDP program by which the kernel hands frames of one NIC to an XdpTransport before its IP
// layer sees them, and the maps that it reads.
//
// It takes frames with UDP to the port and to one of the addresses that were told, without a tag or
// with one that names no VLAN, and puts the time (CLOCK_MONOTONIC) before each where the driver
// leaves room for that. All others go on to the kernel as if it were not there: other ports and
// addresses, VLANs, fragments of IPv6, extension headers. It is a sieve and no judge: what it takes
// is read by parse_frame(). The kernel has verified that it reads nothing beyond a frame and ends.
//
// The program stays on the NIC as long as this object lives, and goes with its process, however
// that ends. Owns its file descriptors. Needs CAP_BPF and CAP_NET_ADMIN, and no CAP_PERFMON: it
// does no arithmetic on pointers but with constants. Errors: the constructor throws IoError, also
// when another XDP program is on the NIC; later on what the kernel refuses makes frames go to the
// kernel. Thread-compatible.
#pragma once

#include <linux/bpf.h>

#include <array>
#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "interneuron/address.h"
#include "node/io/file_descriptor.h"

namespace interneuron::io {

// What stands before the bytes of a frame: when it came, nanoseconds.
using XdpStamp = std::uint64_t;

// The program itself. `addresses`: of a hash map with keys of 16 bytes, an address of IPv4 in the
// first four of them; `sockets`: of a map of AF_XDP sockets by receive queue. Pure.
struct XdpFilter {
  bool ipv6 = false;
  std::uint16_t port = 0;
  int addresses = -1;
  int sockets = -1;
};
std::vector<bpf_insn> xdp_filter(const XdpFilter& wanted);

class XdpProgram {
 public:
  // How many addresses of a NIC it knows; frames to further ones go to the kernel. No measurement
  // behind this value: NICs have a handful.
  static constexpr std::uint32_t kMostAddresses = 256;
  // An address as the program looks it up: one of IPv4 stands in the first four bytes.
  using Key = std::array<std::byte, 16>;

  // Throws IoError (EPERM) with the remedy when this process may not load such programs.
  static void require_privilege();

  // Puts it on the NIC with this index, for at most so many receive queues; `nic`: its name, for
  // errors.
  XdpProgram(int index, const std::string& nic, bool ipv6, std::uint16_t port,
             std::uint32_t queues);

  // Frames of this receive queue go to this socket from now on. Throws IoError.
  void add_socket(std::uint32_t queue, int socket);
  // Frames to these addresses are taken from now on, and to no others.
  void take_addresses(std::span<const Address> addresses);

 private:
  std::string nic_;
  std::set<Key> known_;
  FileDescriptor addresses_;
  FileDescriptor sockets_;
  FileDescriptor program_;
  // The program leaves the NIC when this is closed.
  FileDescriptor link_;
};

}  // namespace interneuron::io
