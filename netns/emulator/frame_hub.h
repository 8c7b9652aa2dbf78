// Receives Ethernet frames from all NICs of a network namespace by one TPACKET_V2 ring, with the
// kernel's time of arrival, and sends frames by sendmmsg past the queueing disciplines (packet(7),
// PACKET_QDISC_BYPASS). One pair of sockets serves all NICs, because the kernel waits for an RCU
// grace period (10 ms) or two whenever a packet socket is made or closed: with a pair for each of
// forty links, taking a testbed down would need seconds.
//
// Bounds: a ring of 32 MB (1 MB at least, when memory is short) and frames of somewhat less than
// 2 KiB; what does not fit is lost and counted. Needs CAP_NET_RAW. Owns its sockets and the ring.
// Thread-compatible. Errors: the constructor throws TestbedError (1); afterwards none.
#pragma once

#include <linux/if_packet.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "interneuron/time.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

class FrameHub {
 public:
  // `nics` are NICs of the current network namespace; all other calls name them by their position.
  explicit FrameHub(const std::vector<std::string>& nics);
  ~FrameHub();
  FrameHub(const FrameHub&) = delete;
  FrameHub& operator=(const FrameHub&) = delete;

  struct Frame {
    // The NIC at which it came in.
    std::size_t nic = 0;
    // A view into the ring, valid until release().
    std::span<const std::byte> bytes;
    // When it arrived, by CLOCK_REALTIME: the ring offers no other clock.
    Duration arrival_realtime{};
    // The sender left the transport checksum to its NIC (complete_checksum() computes it).
    bool checksum_missing = false;
  };

  // The oldest frame that waits, if any. release() gives its place back to the kernel and must be
  // called before the next receive().
  std::optional<Frame> receive();
  void release();

  // Readable when a frame waits.
  int fd() const { return receive_.get(); }

  // Frames per system call. No measurement is behind this value: it only has to be so large that
  // the cost of the call is small against that of its frames.
  static constexpr std::size_t kBatch = 64;
  // Sends up to kBatch frames out of one NIC and returns how many the kernel took. A frame that it
  // refused (no memory, no carrier) is lost.
  std::size_t send(std::size_t nic, std::span<const iovec> frames);

  // The number of frames lost since the last call because the ring was full or because they were
  // longer than a place in it.
  std::uint64_t take_losses();

 private:
  void make_ring();

  io::FileDescriptor receive_;
  io::FileDescriptor send_;
  // Element [i] is the address by which frames are sent to the NIC at position i.
  std::vector<sockaddr_ll> addresses_;
  // The position of a NIC by the kernel's number.
  std::unordered_map<int, std::size_t> positions_;
  std::byte* ring_ = nullptr;
  std::size_t ring_frames_ = 0;
  std::size_t next_ = 0;
  std::uint64_t too_long_ = 0;
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace interneuron::netns
