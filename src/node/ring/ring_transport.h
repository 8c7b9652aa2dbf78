// One NIC's packet socket as a Transport, and the ring of the kernel that it receives from.
#pragma once

#include <linux/filter.h>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "interneuron/time.h"
#include "interneuron/units.h"
#include "node/io/file_descriptor.h"
#include "node/ring/frame_transport.h"

namespace interneuron::io {

// struct virtio_net_hdr of the virtio standard (its section "Device Operation" of network devices),
// which stands before each frame and says what is left to do to it; in the byte order of this host.
// The header of Linux that has it cannot be compiled as C++.
struct OffloadHeader {
  // The checksum that begins at `checksum_start` and is stored `checksum_offset` behind is to be
  // completed; the checksum has been verified.
  static constexpr std::uint8_t kNeedsChecksum = 1;
  static constexpr std::uint8_t kChecksumValid = 2;
  // Nothing to segment; UDP datagrams that follow each other (Linux 6.2); a mark beside either.
  static constexpr std::uint8_t kNoSegments = 0;
  static constexpr std::uint8_t kUdpSegments = 5;
  static constexpr std::uint8_t kEcnMark = 0x80;

  std::uint8_t flags = 0;
  std::uint8_t kind = kNoSegments;
  std::uint16_t header_bytes = 0;
  std::uint16_t segment_bytes = 0;
  std::uint16_t checksum_start = 0;
  std::uint16_t checksum_offset = 0;
};
static_assert(sizeof(OffloadHeader) == 10);

// The kernel's receive ring of packets (TPACKET_V3, packet_mmap.rst of the Linux documentation)
// behind one packet socket: frames of one NIC arrive in memory that the kernel shares, without a
// copy and without a call.
//
// The ring has blocks; the kernel fills one at a time and hands it over when it is full or
// kBlockTime old, so that a datagram that comes alone is seen up to kBlockTime (and a tick of the
// kernel before Linux 6.18) late. Blocks are handed over and given back in order. While all are
// handed over the kernel drops what comes and counts it: since even a single datagram takes a
// block, the ring lasts kBlocks * kBlockTime, 128 ms, or kBlocks * kBlockBytes, 16 MiB, whichever
// is reached first.
//
// What strangers can do: fill it, with what the filter passes. What is in a block was written by
// the kernel; its offsets are held against the block's bounds all the same. Memory: 16 MiB of the
// kernel's, locked. Owns socket and mapping. Errors: the constructor throws IoError; later on
// nothing fails. Thread-compatible.
class PacketRing {
 public:
  // How old a block gets before it is handed over, the least that the kernel can be asked for.
  static constexpr std::chrono::milliseconds kBlockTime{1};
  // A block holds at least one packet of 65535 bytes with what the kernel adds; the kernel wants a
  // power of two pages.
  static constexpr std::size_t kBlockBytes = 128 * 1024;
  static constexpr std::size_t kBlocks = 128;

  // A frame in the ring.
  struct Frame {
    // As it was on the wire, with the Ethernet header where the device has one.
    ByteView bytes;
    // What the kernel says of its checksum and its segments.
    OffloadHeader offload{};
    // The TCI of a tag that the kernel has taken off.
    std::optional<std::uint16_t> tag{};
    // CLOCK_REALTIME of the arrival.
    Duration stamp{};
    // Whether the kernel or the NIC has verified the checksum, or none was computed yet.
    bool checksum_known = false;
    // Whether there is more of it than fits into `bytes`.
    bool cut = false;
  };

  // Throws IoError (EPERM) with the remedy when this process has no CAP_NET_RAW.
  static void require_privilege();

  // Opens a socket for the frames of the NIC `index` that `filter` passes; `nic`: its name, for
  // errors. Needs CAP_NET_RAW. What this host itself sends is not seen.
  PacketRing(int index, const std::string& nic, std::size_t send_buffer_bytes);
  ~PacketRing();
  PacketRing(const PacketRing&) = delete;
  PacketRing& operator=(const PacketRing&) = delete;

  // Begins to receive. To be called once. Throws IoError.
  void start(std::span<const sock_filter> filter);

  int native_handle() const { return socket_.get(); }
  std::size_t send_buffer_bytes() const { return send_buffer_bytes_; }

  // Gives back the block that was handed over last and takes the next one; false when there is
  // none. Frames and their bytes are valid until then.
  bool next_block();
  // Whether a block is handed over.
  bool holds_block() const { return block_ != nullptr; }
  // The next frame of the block; nothing at its end.
  std::optional<Frame> next_frame();
  // How many frames the kernel has dropped since the last call, because the ring was full.
  std::uint64_t take_drops();

 private:
  void set_up_ring();
  void release();

  int index_;
  std::string nic_;
  FileDescriptor socket_;
  std::size_t send_buffer_bytes_ = 0;
  std::byte* memory_ = nullptr;
  // The block to be looked at next, and whether the one before is still ours.
  std::size_t next_ = 0;
  std::byte* block_ = nullptr;
  // Where the next frame stands in the block, and how many are left.
  std::size_t frame_at_ = 0;
  std::size_t frames_left_ = 0;
  bool dropped_ = false;
};

// One NIC's packet socket as a Transport: datagrams leave and arrive as frames (FrameTransport).
//
// Datagrams arrive in a ring that the kernel shares (PacketRing), without copies and calls, up to
// 1 ms after their arrival, with the kernel's stamps, coalesced where the NIC or a sender on this
// host has left them so. Datagrams of equal size to one address leave as one frame that the kernel
// or the NIC segments (virtio_net_hdr, Linux 6.2), many per call (sendmmsg), their checksums left
// to the NIC. They queue behind the NIC like all others (no PACKET_QDISC_BYPASS). What the kernel
// refuses to segment is sent one by one. Devices without Ethernet headers (tun, modems in raw IP
// mode) and the loopback card work too; others are refused by the constructor. On the loopback card
// a ring reaches only other rings: the kernel takes a frame from 127.0.0.0/8 that it did not send
// itself for a forgery (RFC 1122 §3.2.1.3).
//
// What strangers can do: as with every FrameTransport. A filter of the kernel passes frames to this
// port. A flood fills the ring; what does not fit is dropped by the kernel and counted.
//
// Memory: the ring, 16 MiB of the kernel's. receive()'s views lie in the ring and are valid until
// the next call. Owns its sockets. Needs CAP_NET_RAW.
// Thread-compatible. Errors: the constructor throws IoError; later on errors are counted.
class RingTransport final : public FrameTransport {
 public:
  // UdpOptions::receive_buffer_bytes is not used: the ring has its own size. Throws IoError.
  explicit RingTransport(const UdpOptions& options);
  ~RingTransport() override;

  BatchResult send(std::span<const Outgoing> batch) override;
  // `receive_calls` counts blocks of the ring.
  int native_handle() const override { return ring_.native_handle(); }

 private:
  struct SendBuffers;

  int offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) override;
  void collect(TimePoint now) override;
  Obstacle prepare(std::span<const Outgoing> run, std::size_t message, TimePoint now);
  std::size_t fill(std::span<const Outgoing> batch, bool segment, TimePoint now,
                   Obstacle& obstacle);
  std::size_t count_sent(int messages);
  void take_frame(const PacketRing::Frame& frame, TimePoint now, Duration wall_offset);

  PacketRing ring_;
  // Segmented sends that the kernel has refused in a row.
  std::size_t refusals_ = 0;
  // Datagrams of the batch in hand before this one go one by one, because the kernel refused to
  // segment them.
  std::size_t unsegmented_until_ = 0;
  std::unique_ptr<SendBuffers> out_;
};

}  // namespace interneuron::io
