// One NIC's packet socket as a Transport: datagrams leave and arrive as frames, beside the kernel's
// IP layer, sockets and packet filter.
//
// Datagrams arrive in a ring that the kernel shares (PacketRing), without copies and calls, up to
// 1 ms after their arrival, with the kernel's stamps, coalesced where the NIC or a sender on this
// host has left them so. Datagrams of equal size to one address leave as one frame that the kernel
// or the NIC segments (virtio_net_hdr, Linux 6.2), many per call (sendmmsg), their checksums left
// to the NIC. They queue behind the NIC like all others (no PACKET_QDISC_BYPASS). What the kernel
// refuses to segment is sent one by one. Where frames go is said by NextHops: while the hardware
// address of a peer is being asked for, send() refuses (BatchResult::refused); nothing is queued.
// An unreachable peer, a datagram larger than the NIC's MTU or an address of the other family drops
// the datagram and is counted. Devices without Ethernet headers (tun, modems in raw IP mode) and
// the loopback card work too; others are refused by the constructor. On the loopback card a ring
// reaches only other rings: the kernel takes a frame from 127.0.0.0/8 that it did not send itself
// for a forgery (RFC 1122 §3.2.1.3).
//
// A UDP socket on the same address holds the port, so that others cannot have it and the kernel
// answers no datagram with "port unreachable"; a filter drops all that it would receive.
//
// What strangers can do: anybody may send frames. Nothing of the kernel stands between: nftables,
// NAT, reverse path filters do not apply, and warnings() says so. A filter of the kernel passes
// frames to this port; parse_frame() judges them. Datagrams to other addresses than the NIC's own
// (or the one that is bound), fragments, VLANs and multicast are refused; what parse_frame()
// refuses is counted by reason. The address of the sender can be forged, as with any datagram. A
// flood fills the ring (PacketRing); what does not fit is dropped by the kernel and counted.
// UdpOptions::answer_from_receiver works as in UdpTransport.
//
// Memory: the ring, 16 MiB of the kernel's. receive()'s views lie in the ring and are valid until
// the next call. Owns its sockets. Needs CAP_NET_RAW.
// Thread-compatible. Errors: the constructor throws IoError; later on errors are counted.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "host/io/frame.h"
#include "host/io/next_hops.h"
#include "host/io/packet_ring.h"
#include "host/io/receiver_notes.h"
#include "host/io/udp_socket.h"
#include "interneuron/transport.h"

namespace interneuron::io {

class RingTransport final : public Transport {
 public:
  // UdpOptions::receive_buffer_bytes is not used: the ring has its own size. Throws IoError.
  explicit RingTransport(const UdpOptions& options);
  ~RingTransport() override;

  BatchResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
  TransportCaps capabilities() const override { return capabilities_; }
  // `receive_calls` counts blocks of the ring.
  TransportCounters counters() const override { return counters_; }
  Address local_address() const override { return holder_.local; }
  int native_handle() const override { return ring_.native_handle(); }

  // One line each: that the kernel's packet filter is bypassed, and what could not be had as asked.
  const std::vector<std::string>& warnings() const { return warnings_; }
  // Frames for this port that were refused for this reason; they are among `receive_errors`.
  std::uint64_t refused(FrameProblem problem) const {
    return refused_[static_cast<std::size_t>(problem)];
  }

 private:
  struct SendBuffers;
  // What keeps the head of a batch from being sent: nothing (0), an errno, or `asking`.
  struct Obstacle {
    int error = 0;
    bool asking = false;
  };

  void read_card();
  void follow_changes(TimePoint now);
  std::size_t fill(std::span<const Outgoing> batch, bool segment, TimePoint now,
                   Obstacle& obstacle);
  Obstacle prepare(std::span<const Outgoing> run, std::size_t message, TimePoint now);
  int offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result);
  std::size_t count_sent(int messages);
  std::size_t drop(std::size_t count, int error);
  void take(const PacketRing::Frame& frame, TimePoint now, Duration wall_offset);
  bool is_ours(const Address& to) const;
  void refuse(FrameProblem problem);

  UdpSocket holder_;
  bool note_receivers_;
  // The NIC as it was found, and as it is now: index, MTU, addresses.
  Nic card_;
  PacketRing ring_;
  PacketRing::Device device_;
  NextHops hops_;
  ReceiverNotes notes_;
  TransportCaps capabilities_;
  TransportCounters counters_;
  std::array<std::uint64_t, kFrameProblems> refused_{};
  // Segmented sends that the kernel has refused in a row.
  std::size_t refusals_ = 0;
  // Datagrams of the batch in hand before this one go one by one, because the kernel refused to
  // segment them.
  std::size_t unsegmented_until_ = 0;
  bool gone_ = false;
  std::vector<std::string> warnings_;
  std::unique_ptr<SendBuffers> out_;
  std::vector<Incoming> datagrams_;
};

}  // namespace interneuron::io
