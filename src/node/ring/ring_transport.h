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
#pragma once

#include <memory>

#include "node/ring/frame_transport.h"
#include "node/ring/packet_ring.h"

namespace interneuron::io {

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
