// One NIC of the middle namespace as the emulator sees it: Ethernet frames in by a TPACKET_V2 ring,
// with the kernel's time of arrival, and out by sendmmsg past the queueing disciplines (packet(7),
// PACKET_QDISC_BYPASS). Thread-compatible. Needs CAP_NET_RAW. Errors: the constructor throws
// TestbedError (1).
#pragma once

#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "interneuron/time.h"
#include "io/file_descriptor.h"

namespace interneuron::netns {

class FramePort {
 public:
  explicit FramePort(const std::string& nic);
  ~FramePort();
  FramePort(const FramePort&) = delete;
  FramePort& operator=(const FramePort&) = delete;

  struct Frame {
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
  // Sends up to kBatch frames. Returns how many the kernel took; what it refused (no memory, no
  // carrier) is gone.
  std::size_t send(std::span<const iovec> frames);

  // Frames that the kernel has lost since the last call, as the ring was full, and those longer
  // than a place in it.
  std::uint64_t take_losses();

  // Clears a pending error of the socket (the NIC was set down), which would keep it readable for
  // ever.
  void clear_error();

 private:
  void make_ring(const std::string& nic);

  io::FileDescriptor receive_;
  io::FileDescriptor send_;
  std::byte* ring_ = nullptr;
  std::size_t ring_frames_ = 0;
  std::size_t next_ = 0;
  std::uint64_t too_long_ = 0;
  std::array<mmsghdr, kBatch> messages_{};
};

}  // namespace interneuron::netns
