#include "node/ring/packet_ring.h"

#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <sys/mman.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "interneuron/transport.h"
#include "node/io/this_program.h"

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

}  // namespace interneuron::io
