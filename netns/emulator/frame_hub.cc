#include "netns/emulator/frames.h"

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <net/if.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <utility>

#include "netns/state/check.h"
#include "netns/state/error.h"

namespace interneuron::netns {

namespace {

// A place of the ring holds its header of 68 bytes, an Ethernet header and 1500 bytes. Rounded up,
// so that a block (kRingBlockBytes) holds a whole number of places.
constexpr std::size_t kPlaceBytes = 2048;
// 16384 places (32 MB) last for 60 ms of the fastest sender measured, 250 thousand packets a second
// (docs/constants.md, "The testbed on a machine").
constexpr std::size_t kMaxPlaces = 16384;
constexpr std::size_t kMinPlaces = 512;
constexpr std::size_t kRingBlockBytes = std::size_t{128} * 1024;
constexpr int kSendBufferBytes = 4 << 20;

io::FileDescriptor open_packet_socket() {
  // With protocol 0 the socket receives nothing until it is bound.
  const int fd = ::socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, 0);
  if (fd < 0 && (errno == EPERM || errno == EACCES)) {
    throw TestbedError(5,
                       "not permitted to open a packet socket for the links of a testbed; run as "
                       "root with CAP_NET_RAW");
  }
  return io::FileDescriptor(check(fd, "open a packet socket"));
}

void set_option(int fd, int level, int name, int value, const std::string& what) {
  check(::setsockopt(fd, level, name, &value, sizeof value), what);
}

}  // namespace

FrameHub::FrameHub(const std::vector<std::string>& nics)
    : receive_(open_packet_socket()), send_(open_packet_socket()) {
  for (const std::string& nic : nics) {
    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    address.sll_ifindex = static_cast<int>(::if_nametoindex(nic.c_str()));
    if (address.sll_ifindex == 0) fail_errno("find the NIC " + nic);
    positions_.emplace(address.sll_ifindex, addresses_.size());
    addresses_.push_back(address);
  }
  // Frames that this process sends must not be received again. Those that bypass the queueing
  // disciplines are not shown to packet sockets anyway, but no manual promises that.
  set_option(receive_.get(), SOL_PACKET, PACKET_IGNORE_OUTGOING, 1, "ignore outgoing frames");
  make_ring();
  sockaddr_ll all{};
  all.sll_family = AF_PACKET;
  all.sll_protocol = htons(ETH_P_ALL);
  check(::bind(receive_.get(), reinterpret_cast<const sockaddr*>(&all), sizeof all),
        "bind a packet socket");

  set_option(send_.get(), SOL_PACKET, PACKET_QDISC_BYPASS, 1, "bypass queueing disciplines");
  // SO_SNDBUFFORCE needs real root. Without it the buffer is cut to the system's limit, which
  // suffices: a veth pair hands frames over at once.
  const int bytes = kSendBufferBytes;
  if (::setsockopt(send_.get(), SOL_SOCKET, SO_SNDBUFFORCE, &bytes, sizeof bytes) != 0) {
    set_option(send_.get(), SOL_SOCKET, SO_SNDBUF, bytes, "set a send buffer");
  }
}

FrameHub::~FrameHub() {
  if (ring_ != nullptr) ::munmap(ring_, ring_frames_ * kPlaceBytes);
}

void FrameHub::make_ring() {
  set_option(receive_.get(), SOL_PACKET, PACKET_VERSION, TPACKET_V2, "choose TPACKET_V2");
  // The ring is kernel memory. When that is short a smaller ring is tried.
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
  check(result, "make a packet ring");
  void* memory = ::mmap(nullptr, places * kPlaceBytes, PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_POPULATE, receive_.get(), 0);
  if (memory == MAP_FAILED) fail_errno("map the packet ring");
  ring_ = static_cast<std::byte*>(memory);
  ring_frames_ = places;
}

std::optional<FrameHub::Frame> FrameHub::receive() {
  while (true) {
    std::byte* const place = ring_ + next_ * kPlaceBytes;
    auto* header = reinterpret_cast<tpacket2_hdr*>(place);
    const std::uint32_t status = std::atomic_ref(header->tp_status).load(std::memory_order_acquire);
    if ((status & TP_STATUS_USER) == 0) return std::nullopt;
    const auto* from =
        reinterpret_cast<const sockaddr_ll*>(place + TPACKET_ALIGN(sizeof(tpacket2_hdr)));
    const auto position = positions_.find(from->sll_ifindex);
    const bool too_long = header->tp_snaplen < header->tp_len;
    if (position == positions_.end() || too_long) {
      if (too_long) ++too_long_;
      release();
      continue;
    }
    return Frame{position->second,
                 {place + header->tp_mac, header->tp_snaplen},
                 std::chrono::seconds{header->tp_sec} + Duration{header->tp_nsec},
                 (status & TP_STATUS_CSUMNOTREADY) != 0};
  }
}

void FrameHub::release() {
  auto* header = reinterpret_cast<tpacket2_hdr*>(ring_ + next_ * kPlaceBytes);
  std::atomic_ref(header->tp_status).store(TP_STATUS_KERNEL, std::memory_order_release);
  next_ = (next_ + 1) % ring_frames_;
}

std::size_t FrameHub::send(std::size_t nic, std::span<const iovec> frames) {
  const std::size_t count = std::min(frames.size(), kBatch);
  for (std::size_t i = 0; i < count; ++i) {
    msghdr& message = messages_[i].msg_hdr;
    message.msg_name = &addresses_[nic];
    message.msg_namelen = sizeof(sockaddr_ll);
    message.msg_iov = const_cast<iovec*>(&frames[i]);
    message.msg_iovlen = 1;
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
      // The kernel refused this frame: it is dropped, as by a real NIC.
      ++done;
    }
  }
  return sent;
}

std::uint64_t FrameHub::take_losses() {
  tpacket_stats statistics{};
  socklen_t size = sizeof statistics;
  std::uint64_t losses = std::exchange(too_long_, 0);
  // Reading the kernel's counter resets it.
  if (::getsockopt(receive_.get(), SOL_PACKET, PACKET_STATISTICS, &statistics, &size) == 0) {
    losses += statistics.tp_drops;
  }
  return losses;
}

}  // namespace interneuron::netns
