#include "node/ring/ring_transport.h"

#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "interneuron/transport.h"
#include "node/io/parts.h"
#include "node/io/segment_run.h"
#include "node/io/steady_clock.h"
#include "node/io/this_program.h"
#include "node/ring/ring_filter.h"

namespace interneuron::io {

namespace {

[[noreturn]] void ring_failed(const std::string& nic, const char* call, int error) {
  if (error == EPERM || error == EACCES) {
    throw IoError("not permitted to open a packet socket for " + nic + " (" + call +
                      "); run `sudo setcap cap_net_raw+ep " + this_program() +
                      "`, run as root, or use --transport udp",
                  error);
  }
  throw IoError("cannot receive packets of " + nic + " in a ring (" + call + ": " +
                    std::strerror(error) + "); use --transport udp",
                error);
}

// A struct that the kernel wrote at `at`, which need not be aligned for a stranger's reader.
template <class Value>
Value read_at(const std::byte* at) {
  Value value{};
  std::memcpy(&value, at, sizeof value);
  return value;
}

std::uint32_t* status_of(std::byte* block) {
  return reinterpret_cast<std::uint32_t*>(block + offsetof(tpacket_block_desc, hdr) +
                                          offsetof(tpacket_hdr_v1, block_status));
}

// Returns what the kernel granted, which doubles what it is asked (man 7 socket).
std::size_t set_send_buffer(int fd, std::size_t wanted) {
  const int value = static_cast<int>(std::min<std::size_t>(wanted, 1 << 30));
  if (::setsockopt(fd, SOL_SOCKET, SO_SNDBUFFORCE, &value, sizeof value) != 0) {
    ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &value, sizeof value);
  }
  int doubled = 0;
  socklen_t size = sizeof doubled;
  if (::getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &doubled, &size) != 0) return 0;
  return static_cast<std::size_t>(std::max(doubled, 0)) / 2;
}

// Where the checksum stands in a UDP header.
constexpr std::uint16_t kUdpCheckAt = 6;

bool kernel_refuses_segmentation(int error) {
  // Kernels before 6.2 do not know it; others refuse it when the header says what cannot be.
  return error == EINVAL || error == EMSGSIZE || error == EIO || error == EOPNOTSUPP;
}

}  // namespace

void PacketRing::require_privilege() {
  const FileDescriptor socket(::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0));
  if (socket.get() < 0) ring_failed("--transport ring", "socket AF_PACKET", errno);
}

PacketRing::PacketRing(int index, const std::string& nic, std::size_t send_buffer_bytes)
    : index_(index),
      nic_(nic),
      // Protocol 0: nothing is received before the filter is there.
      socket_(::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  if (socket_.get() < 0) ring_failed(nic_, "socket AF_PACKET", errno);
  send_buffer_bytes_ = set_send_buffer(socket_.get(), send_buffer_bytes);
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_ifindex = index_;
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    ring_failed(nic_, "bind", errno);
  }
  set_up_ring();
}

void PacketRing::set_up_ring() {
  const int fd = socket_.get();
  const int version = TPACKET_V3;
  const int on = 1;
  if (::setsockopt(fd, SOL_PACKET, PACKET_VERSION, &version, sizeof version) != 0) {
    ring_failed(nic_, "setsockopt PACKET_VERSION", errno);
  }
  // Before the ring, or the kernel refuses it.
  if (::setsockopt(fd, SOL_PACKET, PACKET_VNET_HDR, &on, sizeof on) != 0) {
    ring_failed(nic_, "setsockopt PACKET_VNET_HDR", errno);
  }
  if (::setsockopt(fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0) {
    ring_failed(nic_, "setsockopt PACKET_IGNORE_OUTGOING", errno);
  }
  tpacket_req3 wanted{};
  wanted.tp_block_size = kBlockBytes;
  wanted.tp_block_nr = kBlocks;
  // Frames take what they need; the kernel only checks that these two agree with the blocks.
  wanted.tp_frame_size = kBlockBytes;
  wanted.tp_frame_nr = kBlocks;
  wanted.tp_retire_blk_tov = static_cast<unsigned>(kBlockTime.count());
  if (::setsockopt(fd, SOL_PACKET, PACKET_RX_RING, &wanted, sizeof wanted) != 0) {
    ring_failed(nic_, "setsockopt PACKET_RX_RING", errno);
  }
  void* memory = ::mmap(nullptr, kBlockBytes * kBlocks, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (memory == MAP_FAILED) ring_failed(nic_, "mmap", errno);
  memory_ = static_cast<std::byte*>(memory);
}

PacketRing::~PacketRing() {
  if (memory_ != nullptr) ::munmap(memory_, kBlockBytes * kBlocks);
}

void PacketRing::start(std::span<const sock_filter> filter) {
  // The kernel only reads the program; it is not const because sock_fprog is older than const.
  const sock_fprog program{static_cast<unsigned short>(filter.size()),
                           const_cast<sock_filter*>(filter.data())};
  if (::setsockopt(socket_.get(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) != 0) {
    ring_failed(nic_, "setsockopt SO_ATTACH_FILTER", errno);
  }
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_ifindex = index_;
  address.sll_protocol = htons(ETH_P_ALL);
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    ring_failed(nic_, "bind", errno);
  }
}

void PacketRing::release() {
  if (block_ == nullptr) return;
  // After everything that was read of the block.
  __atomic_store_n(status_of(block_), std::uint32_t{TP_STATUS_KERNEL}, __ATOMIC_RELEASE);
  block_ = nullptr;
  frames_left_ = 0;
}

bool PacketRing::next_block() {
  release();
  std::byte* block = memory_ + next_ * kBlockBytes;
  // Before anything that is read of the block.
  const std::uint32_t status = __atomic_load_n(status_of(block), __ATOMIC_ACQUIRE);
  if ((status & TP_STATUS_USER) == 0) return false;
  const auto header = read_at<tpacket_hdr_v1>(block + offsetof(tpacket_block_desc, hdr));
  dropped_ = dropped_ || (status & TP_STATUS_LOSING) != 0;
  block_ = block;
  next_ = (next_ + 1) % kBlocks;
  frame_at_ = header.offset_to_first_pkt;
  frames_left_ = header.num_pkts;
  return true;
}

std::optional<PacketRing::Frame> PacketRing::next_frame() {
  if (frames_left_ == 0 || frame_at_ > kBlockBytes - sizeof(tpacket3_hdr)) return std::nullopt;
  const std::byte* at = block_ + frame_at_;
  const auto header = read_at<tpacket3_hdr>(at);
  const std::size_t room = kBlockBytes - frame_at_;
  if (header.tp_mac < sizeof(tpacket3_hdr) + sizeof(OffloadHeader) || header.tp_mac > room ||
      header.tp_snaplen > room - header.tp_mac) {
    frames_left_ = 0;
    return std::nullopt;
  }
  --frames_left_;
  frame_at_ += header.tp_next_offset;
  Frame out;
  out.bytes = {at + header.tp_mac, header.tp_snaplen};
  // The kernel writes it right before the frame.
  out.offload = read_at<OffloadHeader>(at + header.tp_mac - sizeof(OffloadHeader));
  if ((header.tp_status & TP_STATUS_VLAN_VALID) != 0) {
    out.tag = static_cast<std::uint16_t>(header.hv1.tp_vlan_tci);
  }
  out.stamp = std::chrono::seconds(header.tp_sec) + std::chrono::nanoseconds(header.tp_nsec);
  out.checksum_known =
      (header.tp_status & (TP_STATUS_CSUMNOTREADY | TP_STATUS_CSUM_VALID)) != 0 ||
      (out.offload.flags & (OffloadHeader::kNeedsChecksum | OffloadHeader::kChecksumValid)) != 0;
  out.cut = header.tp_snaplen < header.tp_len;
  return out;
}

std::uint64_t PacketRing::take_drops() {
  if (!std::exchange(dropped_, false)) return 0;
  // The kernel counts from the last reading on.
  tpacket_stats_v3 stats{};
  socklen_t size = sizeof stats;
  if (::getsockopt(socket_.get(), SOL_PACKET, PACKET_STATISTICS, &stats, &size) != 0) return 0;
  return stats.tp_drops;
}

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
