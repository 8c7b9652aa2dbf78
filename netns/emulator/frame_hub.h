// All NICs of a network namespace as the emulator sees them: Ethernet frames in by one TPACKET_V2
// ring, with the kernel's time of arrival, and out by sendmmsg past the queueing disciplines
// (packet(7), PACKET_QDISC_BYPASS). One pair of sockets for all, because the kernel waits for an
// RCU grace period (10 ms) or two whenever one is made or closed: forty links would take seconds
// to go. Thread-compatible. Needs CAP_NET_RAW. Errors: the constructor throws TestbedError (1).
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

#include "host/io/file_descriptor.h"
#include "interneuron/time.h"

namespace interneuron::netns {

class FrameHub {
 public:
  // NICs of the current network namespace, known by their position from here on.
  explicit FrameHub(const std::vector<std::string>& nics);
  ~FrameHub();
  FrameHub(const FrameHub&) = delete;
  FrameHub& operator=(const FrameHub&) = delete;

  struct Frame {
    std::size_t nic = 0;               // where it came in
    std::span<const std::byte> bytes;  // within the ring; valid until release()
    Duration arrival_realtime{};       // CLOCK_REALTIME: the ring knows no other clock
    bool checksum_missing = false;     // left to the NIC by the sender
  };

  // The oldest frame, if there is one; release() gives its place back to the kernel and must be
  // called before the next.
  std::optional<Frame> receive();
  void release();

  // Readable when there is a frame.
  int fd() const { return receive_.get(); }

  static constexpr std::size_t kBatch = 64;
  // Sends up to kBatch frames out of one NIC. Returns how many the kernel took; what it refused (no
  // memory, no carrier) is gone.
  std::size_t send(std::size_t nic, std::span<const iovec> frames);

  // Frames that the kernel has lost since the last call, as the ring was full, and those longer
  // than a place in it.
  std::uint64_t take_losses();

 private:
  void make_ring();

  io::FileDescriptor receive_;
  io::FileDescriptor send_;
  std::vector<sockaddr_ll> addresses_;              // of the NICs, to send
  std::unordered_map<int, std::size_t> positions_;  // of the NICs, by the kernel's number
  std::byte* ring_ = nullptr;
  std::size_t ring_frames_ = 0;
  std::size_t next_ = 0;
  std::uint64_t too_long_ = 0;
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace interneuron::netns
