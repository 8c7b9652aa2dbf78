#include "netns/frame_port.h"

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>

#include "netns/check.h"

namespace interneuron::netns {

namespace {

// One place holds the ring's header (68 bytes), the Ethernet header and 1500 bytes.
constexpr std::size_t kPlaceBytes = 2048;
// 8192 places last for 30 ms of the fastest sender measured (testbed.md §4: 250 thousand packets a
// second).
constexpr std::size_t kMaxPlaces = 8192;
constexpr std::size_t kMinPlaces = 512;
constexpr std::size_t kRingBlockBytes = std::size_t{128} * 1024;
constexpr int kSendBufferBytes = 4 << 20;

io::FileDescriptor open_packet_socket() {
  // Protocol 0: nothing is received until bound.
  return io::FileDescriptor(
      check(::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0), "open a packet socket"));
}

void set_option(int fd, int level, int name, int value, const std::string& what) {
  check(::setsockopt(fd, level, name, &value, sizeof value), what);
}

void bind_to(int fd, const std::string& nic, std::uint16_t protocol) {
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(protocol);
  address.sll_ifindex = static_cast<int>(::if_nametoindex(nic.c_str()));
  if (address.sll_ifindex == 0) fail_errno("find the NIC " + nic);
  check(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address),
        "bind a packet socket to " + nic);
}

}  // namespace

FramePort::FramePort(const std::string& nic)
    : receive_(open_packet_socket()), send_(open_packet_socket()) {
  // What the other direction sends out here must not come back in. Frames that bypass the queueing
  // disciplines are not shown to packet sockets anyway, but no manual promises it.
  set_option(receive_.get(), SOL_PACKET, PACKET_IGNORE_OUTGOING, 1, "ignore outgoing frames");
  make_ring(nic);
  bind_to(receive_.get(), nic, ETH_P_ALL);

  set_option(send_.get(), SOL_PACKET, PACKET_QDISC_BYPASS, 1, "bypass queueing disciplines");
  // FORCE needs real root; without it the system's limit holds, which is fine for veth: frames are
  // handed over at once.
  const int bytes = kSendBufferBytes;
  if (::setsockopt(send_.get(), SOL_SOCKET, SO_SNDBUFFORCE, &bytes, sizeof bytes) != 0) {
    set_option(send_.get(), SOL_SOCKET, SO_SNDBUF, bytes, "set a send buffer");
  }
  bind_to(send_.get(), nic, 0);
}

FramePort::~FramePort() {
  if (ring_ != nullptr) ::munmap(ring_, ring_frames_ * kPlaceBytes);
}

void FramePort::make_ring(const std::string& nic) {
  set_option(receive_.get(), SOL_PACKET, PACKET_VERSION, TPACKET_V2, "choose TPACKET_V2");
  // The ring is memory of the kernel; when that is short, a smaller one still works.
  int result = -1;
  std::size_t places = kMaxPlaces;
  for (; places >= kMinPlaces; places /= 2) {
    tpacket_req request{};
    request.tp_frame_size = kPlaceBytes;
    request.tp_frame_nr = static_cast<unsigned>(places);
    request.tp_block_size = kRingBlockBytes;
    request.tp_block_nr = static_cast<unsigned>(places * kPlaceBytes / kRingBlockBytes);
    result = ::setsockopt(receive_.get(), SOL_PACKET, PACKET_RX_RING, &request, sizeof request);
    if (result == 0 || errno != ENOMEM) break;
  }
  check(result, "make a packet ring on " + nic);
  void* memory = ::mmap(nullptr, places * kPlaceBytes, PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_POPULATE, receive_.get(), 0);
  if (memory == MAP_FAILED) fail_errno("map the packet ring of " + nic);
  ring_ = static_cast<std::byte*>(memory);
  ring_frames_ = places;
}

std::optional<FramePort::Frame> FramePort::receive() {
  while (true) {
    std::byte* const place = ring_ + next_ * kPlaceBytes;
    auto* header = reinterpret_cast<tpacket2_hdr*>(place);
    const std::uint32_t status = std::atomic_ref(header->tp_status).load(std::memory_order_acquire);
    if ((status & TP_STATUS_USER) == 0) return std::nullopt;
    if (header->tp_snaplen < header->tp_len) {
      ++too_long_;
      release();
      continue;
    }
    return Frame{{place + header->tp_mac, header->tp_snaplen},
                 std::chrono::seconds{header->tp_sec} + Duration{header->tp_nsec},
                 (status & TP_STATUS_CSUMNOTREADY) != 0};
  }
}

void FramePort::release() {
  auto* header = reinterpret_cast<tpacket2_hdr*>(ring_ + next_ * kPlaceBytes);
  std::atomic_ref(header->tp_status).store(TP_STATUS_KERNEL, std::memory_order_release);
  next_ = (next_ + 1) % ring_frames_;
}

std::size_t FramePort::send(std::span<const iovec> frames) {
  const std::size_t count = std::min(frames.size(), kBatch);
  for (std::size_t i = 0; i < count; ++i) {
    messages_[i].msg_hdr.msg_iov = const_cast<iovec*>(&frames[i]);
    messages_[i].msg_hdr.msg_iovlen = 1;
  }
  std::size_t done = 0;
  std::size_t sent = 0;
  while (done < count) {
    const int result = ::sendmmsg(send_.get(), &messages_[done],
                                  static_cast<unsigned>(count - done), MSG_DONTWAIT);
    if (result > 0) {
      done += static_cast<std::size_t>(result);
      sent += static_cast<std::size_t>(result);
    } else {
      ++done;  // a real NIC would have dropped it as well
    }
  }
  return sent;
}

std::uint64_t FramePort::take_losses() {
  tpacket_stats statistics{};
  socklen_t size = sizeof statistics;
  std::uint64_t losses = std::exchange(too_long_, 0);
  // Reading resets the kernel's counter.
  if (::getsockopt(receive_.get(), SOL_PACKET, PACKET_STATISTICS, &statistics, &size) == 0) {
    losses += statistics.tp_drops;
  }
  return losses;
}

void FramePort::clear_error() {
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(receive_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
}

}  // namespace interneuron::netns
