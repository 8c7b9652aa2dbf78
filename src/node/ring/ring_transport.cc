#include "node/ring/ring_transport.h"

#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "node/io/address.h"
#include "node/io/parts.h"
#include "node/io/segment_run.h"
#include "node/io/steady_clock.h"
#include "node/ring/ring_filter.h"

namespace interneuron::io {

namespace {

// Where the checksum stands in a UDP header.
constexpr std::uint16_t kUdpCheckAt = 6;

bool kernel_refuses_segmentation(int error) {
  // Kernels before 6.2 do not know it; others refuse it when the header says what cannot be.
  return error == EINVAL || error == EMSGSIZE || error == EIO || error == EOPNOTSUPP;
}

}  // namespace

struct RingTransport::SendBuffers {
  std::array<mmsghdr, kSendMessages> messages;
  // How many datagrams each message has.
  std::array<std::size_t, kSendMessages> datagrams;
  std::array<iovec, kSendVectors> vectors;
  std::array<sockaddr_ll, kSendMessages> names;
  // What the kernel is to do, and the headers, in one piece.
  std::array<std::array<std::byte, sizeof(OffloadHeader) + kMostHeaderBytes>, kSendMessages>
      headers;
  std::array<std::size_t, kSendMessages> header_bytes;
};

RingTransport::RingTransport(const UdpOptions& options)
    : FrameTransport(options, {.segmentation_offload = true, .receive_offload = true}),
      ring_(card().index, options.nic, options.send_buffer_bytes),
      out_(std::make_unique<SendBuffers>()) {
  capabilities_.send_buffer_bytes = ring_.send_buffer_bytes();
  capabilities_.receive_buffer_bytes = PacketRing::kBlocks * PacketRing::kBlockBytes;
  ring_.start(ring_filter({.ethernet = has_ethernet_headers(),
                           .ipv6 = is_ipv6(local_address()),
                           .port = port_of(local_address())}));
}

RingTransport::~RingTransport() = default;

// Writes the headers of a run of datagrams to one address as message number `message`.
RingTransport::Obstacle RingTransport::prepare(std::span<const Outgoing> run, std::size_t message,
                                               TimePoint now) {
  FrameHeader header;
  if (const Obstacle obstacle = address(run, now, header); obstacle.error != 0) return obstacle;
  OffloadHeader offload{.flags = OffloadHeader::kNeedsChecksum,
                        .header_bytes = static_cast<std::uint16_t>(header.size),
                        .checksum_start = static_cast<std::uint16_t>(header.udp_at),
                        .checksum_offset = kUdpCheckAt};
  if (run.size() > 1) {
    offload.kind = OffloadHeader::kUdpSegments;
    offload.segment_bytes = static_cast<std::uint16_t>(run[0].size());
  }
  auto& out = out_->headers[message];
  std::memcpy(out.data(), &offload, sizeof offload);
  std::ranges::copy(header.view(), out.begin() + sizeof offload);
  out_->header_bytes[message] = sizeof offload + header.size;
  sockaddr_ll& name = out_->names[message];
  name = {};
  name.sll_family = AF_PACKET;
  name.sll_protocol = htons(is_ipv6(run[0].to) ? ETH_P_IPV6 : ETH_P_IP);
  name.sll_ifindex = card().index;
  return {};
}

// Describes the head of `batch` to the kernel; returns the number of messages, and what keeps the
// datagram behind them from being sent.
std::size_t RingTransport::fill(std::span<const Outgoing> batch, bool segment, TimePoint now,
                                Obstacle& obstacle) {
  std::size_t messages = 0;
  std::size_t vectors = 0;
  while (!batch.empty() && messages < kSendMessages) {
    const std::size_t count = segment ? run_length(batch) : 1;
    if (vectors + 1 + kMostParts * count > kSendVectors) break;
    obstacle = prepare(batch.first(count), messages, now);
    if (obstacle.error != 0) break;
    msghdr& header = out_->messages[messages].msg_hdr;
    header = {};
    header.msg_name = &out_->names[messages];
    header.msg_namelen = sizeof out_->names[messages];
    header.msg_iov = &out_->vectors[vectors];
    const std::size_t first = vectors;
    out_->vectors[vectors++] = {out_->headers[messages].data(), out_->header_bytes[messages]};
    for (const Outgoing& datagram : batch.first(count)) {
      for (const ByteView part : {datagram.head, datagram.payload, datagram.tail}) {
        if (part.empty()) continue;
        // The kernel only reads it; it is not const because sendmsg shares its struct with recvmsg.
        out_->vectors[vectors++] = {const_cast<std::byte*>(part.data()), part.size()};
      }
    }
    header.msg_iovlen = vectors - first;
    out_->datagrams[messages++] = count;
    batch = batch.subspan(count);
  }
  return messages;
}

// Counts the datagrams of messages that the kernel has taken; returns how many those are.
std::size_t RingTransport::count_sent(int messages) {
  ++counters_.send_calls;
  std::size_t datagrams = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(messages); ++i) {
    if (out_->datagrams[i] > 1) refusals_ = 0;
    datagrams += out_->datagrams[i];
  }
  counters_.sent_datagrams += datagrams;
  return datagrams;
}

// Offers the head of `batch` to the kernel once. Returns the errno of what stands in the way of the
// first datagram that was not taken; 0: nothing, go on.
int RingTransport::offer(std::span<const Outgoing> batch, TimePoint now, BatchResult& result) {
  const bool segment = capabilities_.segmentation_offload && result.taken >= unsegmented_until_;
  auto rest = batch.subspan(result.taken);
  if (!segment && unsegmented_until_ > result.taken) {
    rest = rest.first(unsegmented_until_ - result.taken);
  }
  Obstacle obstacle;
  const std::size_t messages = fill(rest, segment, now, obstacle);
  if (messages == 0) {
    result.refused = obstacle.asking;
    return obstacle.error;
  }
  const int sent = ::sendmmsg(native_handle(), out_->messages.data(),
                              static_cast<unsigned>(messages), MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent > 0) {
    result.taken += count_sent(sent);
    return 0;
  }
  const int error = errno;
  if (error == EINTR) return 0;
  if (error == EAGAIN || error == EWOULDBLOCK) {
    result.would_block = true;
  } else if (out_->datagrams[0] > 1 && kernel_refuses_segmentation(error)) {
    ++counters_.offload_refused;
    if (++refusals_ >= kRefusalsToGiveUp) capabilities_.segmentation_offload = false;
    unsegmented_until_ = result.taken + out_->datagrams[0];
    return 0;
  } else {
    judge_refusal(error, result);
  }
  return error;
}

BatchResult RingTransport::send(std::span<const Outgoing> batch) {
  unsegmented_until_ = 0;
  return FrameTransport::send(batch);
}

void RingTransport::collect(TimePoint now) {
  const Duration offset = wall_offset();
  const bool was_idle = !ring_.holds_block();
  // A block of which nothing is ours is no reason to stop, but a flood of such must not keep us.
  for (std::size_t i = 0; i < PacketRing::kBlocks && !received_any(); ++i) {
    if (!ring_.next_block()) {
      // A card that goes down leaves an error at the socket, which would be reported as readable
      // until somebody takes it. Whoever gives a block back comes again if there is one.
      int error = 0;
      socklen_t size = sizeof error;
      if (was_idle) ::getsockopt(native_handle(), SOL_SOCKET, SO_ERROR, &error, &size);
      break;
    }
    ++counters_.receive_calls;
    while (const auto frame = ring_.next_frame()) take_frame(*frame, now, offset);
    counters_.receive_queue_drops += ring_.take_drops();
  }
}

void RingTransport::take_frame(const PacketRing::Frame& frame, TimePoint now,
                               Duration wall_offset) {
  if (frame.cut) return refuse(FrameProblem::kTruncated);
  Arrived arrived{.bytes = frame.bytes,
                  .at = instant_of_stamp(frame.stamp, now, wall_offset),
                  .checksum_known = frame.checksum_known,
                  .tag = frame.tag};
  const int kind = frame.offload.kind & ~OffloadHeader::kEcnMark;
  if (kind == OffloadHeader::kUdpSegments) {
    if (frame.offload.segment_bytes == 0) return refuse(FrameProblem::kUdpLength);
    arrived.segment_bytes = frame.offload.segment_bytes;
  } else if (kind != OffloadHeader::kNoSegments) {
    // To be cut into fragments of IP.
    return refuse(FrameProblem::kFragment);
  }
  take(arrived);
}

}  // namespace interneuron::io

const interneuron::io::TransportPart interneuron_ring_part{
    interneuron::io::open_as<interneuron::io::RingTransport>,
    interneuron::io::PacketRing::require_privilege};
