// What AF_XDP consists of: the program on a NIC that picks frames, and the sockets that it hands
// them to, one for each receive queue.
#pragma once

#include <linux/bpf.h>
#include <xdp/xsk.h>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/time.h"
#include "interneuron/units.h"
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

// The AF_XDP socket of one receive queue of a NIC (af_xdp.rst of the Linux documentation) and the
// memory that it shares with the kernel: frames arrive in it and leave from it without a copy where
// the driver can (zero copy), else with one (as on a veth pair).
//
// The memory consists of chunks of kChunkBytes, of which some are for frames that arrive and some
// for those that leave. A chunk belongs to the kernel or to this object, never to both: frames that
// arrived are given back by the next receive(); what has left comes back when the kernel says so.
// While it has no chunk for them, frames that arrive are dropped and counted. Frames leave past the
// queueing discipline of the NIC.
//
// What strangers can do: fill it, with what the program on the NIC hands over. What the kernel
// names is held against the memory's bounds all the same. Memory: kChunks chunks, 16 MiB, locked.
// Owns socket and memory. Errors: the constructor throws IoError; later on nothing fails.
// Thread-compatible.
class XdpSocket {
 public:
  // A page: the largest chunk that every driver takes, and room for every MTU that XDP allows.
  static constexpr std::uint32_t kChunkBytes = 4096;
  // 3072 packets of 1400 bytes are 115 ms of data at 300 Mbit/s, as kReceiveBufferBytes.
  static constexpr std::uint32_t kReceiveChunks = 3072;
  // 1024 packets are twice kSendBufferBytes: a chunk counts as taken until the kernel has said that
  // its frame has left.
  static constexpr std::uint32_t kSendChunks = 1024;
  static constexpr std::uint32_t kChunks = kReceiveChunks + kSendChunks;

  // Throws IoError (EPERM) with the remedy when this process may not share the memory of one socket
  // with the kernel: locked memory is limited (ulimit -l) without CAP_IPC_LOCK.
  static void require_memory();

  // A frame that has arrived.
  struct Frame {
    ByteView bytes;
    // When, by CLOCK_MONOTONIC and as the program on the NIC says.
    std::optional<TimePoint> stamp{};
  };

  // Opens the socket of this receive queue of the NIC with this name. Throws IoError; EBUSY:
  // somebody else has the queue. The kernel takes down a socket that was closed some milliseconds
  // later: where that may be the cause, and `may_wait`, it is waited for.
  XdpSocket(const std::string& nic, std::uint32_t queue, bool may_wait);
  ~XdpSocket();
  XdpSocket(const XdpSocket&) = delete;
  XdpSocket& operator=(const XdpSocket&) = delete;

  int native_handle() const;

  // Frames that have arrived, at most kBatch of them; they and their bytes are valid until the next
  // call.
  static constexpr std::size_t kBatch = 256;
  std::span<const Frame> receive();
  // Frames that the kernel has dropped since the last call, because this object had not given back
  // their chunks in time.
  std::uint64_t take_drops();

  // Room for a frame of at most kChunkBytes that is to leave; empty: all of it is taken. It leaves,
  // with so many bytes, by the next flush() after commit().
  std::span<std::byte> reserve();
  void commit(std::size_t bytes);
  // Tells the kernel what is to leave. Returns the errno that kept it from taking some of that, 0
  // for none; it takes that with the next flush(), and with nothing else.
  int flush();
  // Whether there is something that the kernel takes with the next flush().
  bool needs_flush() const;

 private:
  struct Memory;

  void open(const std::string& nic, std::uint32_t queue, bool may_wait);
  void give_to_kernel(std::span<const std::uint64_t> chunks);
  void take_back_sent();

  std::unique_ptr<Memory> memory_;
  xsk_umem* umem_ = nullptr;
  xsk_socket* socket_ = nullptr;
  xsk_ring_prod fill_{};
  xsk_ring_cons completed_{};
  xsk_ring_cons arrived_{};
  xsk_ring_prod leaving_{};
  // What the last receive() has handed out: the frames, and the chunks that they lie in.
  std::vector<Frame> frames_;
  std::vector<std::uint64_t> lent_;
  // Chunks for frames that leave, and how many were committed since the last flush().
  std::vector<std::uint64_t> free_;
  std::uint64_t drops_ = 0;
};

}  // namespace interneuron::io
