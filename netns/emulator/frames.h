// The Ethernet frames of the emulator: received and sent (FrameHub), kept while they are inside a
// link (FrameStore), and changed on their way (checksums, ECN). Their bytes come from the programs
// in the testbed and may be anything.
#pragma once

#include <linux/if_packet.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/queue.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

// Receives Ethernet frames from all NICs of a network namespace by one TPACKET_V2 ring, with the
// kernel's time of arrival, and sends frames by sendmmsg past the queueing disciplines (packet(7),
// PACKET_QDISC_BYPASS). One pair of sockets serves all NICs, because the kernel waits for an RCU
// grace period (10 ms) or two whenever a packet socket is made or closed: with a pair for each of
// forty links, taking a testbed down would need seconds.
//
// Bounds: a ring of 32 MB (1 MB at least, when memory is short) and frames of somewhat less than
// 2 KiB; what does not fit is lost and counted. Needs CAP_NET_RAW. Owns its sockets and the ring.
// Thread-compatible. Errors: the constructor throws TestbedError (1); afterwards none.
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

// Keeps the bytes of frames that are inside an emulated link, in places of equal size that are
// reused: no allocation per frame once the most frames have been inside. Memory: 2 KiB for each
// frame of that peak, rounded up to blocks of 128, never given back. The queues, rates and delays
// of the links bound how many frames can be inside.
// Pure; thread-compatible. A handle is valid from add() to release(); using it otherwise is an
// error of the caller that is not detected.
class FrameStore {
 public:
  using Handle = std::uint64_t;

  // More than an Ethernet frame with 1500 bytes of IP has.
  static constexpr std::size_t kPlaceBytes = 2048;

  // Keeps a copy of `frame` (at most kPlaceBytes) until release().
  Handle add(std::span<const std::byte> frame) {
    assert(frame.size() <= kPlaceBytes);
    if (free_.empty()) add_block();
    const Handle handle = free_.back();
    free_.pop_back();
    Place& place = at(handle);
    std::copy(frame.begin(), frame.end(), place.bytes.begin());
    place.size = frame.size();
    return handle;
  }

  std::span<std::byte> operator[](Handle handle) {
    Place& place = at(handle);
    return {place.bytes.data(), place.size};
  }

  void release(Handle handle) { free_.push_back(handle); }

  // The number of frames kept.
  std::size_t size() const { return blocks_.size() * kBlockPlaces - free_.size(); }

 private:
  struct Place {
    std::array<std::byte, kPlaceBytes> bytes;
    std::size_t size = 0;
  };
  static constexpr std::size_t kBlockPlaces = 128;

  Place& at(Handle handle) { return blocks_[handle / kBlockPlaces][handle % kBlockPlaces]; }

  void add_block() {
    const Handle first = blocks_.size() * kBlockPlaces;
    blocks_.push_back(std::make_unique<Place[]>(kBlockPlaces));
    for (std::size_t i = kBlockPlaces; i > 0; --i) free_.push_back(first + i - 1);
  }

  std::vector<std::unique_ptr<Place[]>> blocks_;
  // Places that are free. The last one freed is used first, as its memory is still in the CPU
  // cache.
  std::vector<Handle> free_;
};

// Computes the transport checksum (RFC 1071) of an Ethernet frame whose sender left that to its NIC
// (the field then holds only the sum of the pseudo header). Every length in the frame is checked
// against its size. Returns false, and leaves the frame as it is, unless it is unfragmented UDP or
// TCP over IPv4 or over IPv6 without extension headers. Pure; thread-safe.
bool complete_checksum(std::span<std::byte> frame);

// The two ECN bits of an IP packet (RFC 3168, section 5), and what sets them to CE; in IPv4 the
// header's checksum follows. The packet holds all of its header without options, which the caller
// has checked. Pure; thread-safe.
emu::Ecn ecn_of(std::span<const std::byte> packet);
void mark_congestion(std::span<std::byte> packet);

}  // namespace interneuron::netns
