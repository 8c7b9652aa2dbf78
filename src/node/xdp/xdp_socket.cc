#include "node/xdp/xdp_socket.h"

#include <fcntl.h>
#include <linux/if_xdp.h>
#include <sys/mman.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include "interneuron/transport.h"
#include "node/io/steady_clock.h"
#include "node/io/this_program.h"

namespace interneuron::io {

namespace {

// Slots of the rings: powers of two that hold all chunks of their direction.
constexpr std::uint32_t kReceiveSlots = 4096;
constexpr std::uint32_t kSendSlots = 1024;
static_assert(kReceiveSlots >= XdpSocket::kReceiveChunks && kSendSlots >= XdpSocket::kSendChunks);
// What the kernel counts for a packet of a chunk against the send buffer of the socket: the packet
// and what describes it.
constexpr int kXdpSendBufferBytes =
    2 * static_cast<int>(XdpSocket::kSendChunks) * static_cast<int>(XdpSocket::kChunkBytes);
// The kernel takes down a socket that was closed some time later; until then its queue is busy.
constexpr Duration kMostTakingDown = std::chrono::milliseconds(500);
constexpr Duration kTryAgain = std::chrono::milliseconds(2);
// Stamps are of the time that a frame may have waited in the rings.
constexpr Duration kOldest = std::chrono::seconds(10);

[[noreturn]] void xdp_failed(const std::string& nic, const char* call, int error) {
  if (error == EPERM || error == EACCES || error == ENOBUFS) {
    const bool memory = error == ENOBUFS;
    throw IoError((memory ? "not enough locked memory (ulimit -l) for AF_XDP on "
                          : "not permitted to open an AF_XDP socket for ") +
                      nic + " (" + call +
                      "); run `sudo setcap cap_net_raw,cap_net_admin,cap_bpf,cap_ipc_lock+ep " +
                      this_program() + "`, run as root of the host, or use --transport udp",
                  EPERM);
  }
  throw IoError("cannot open an AF_XDP socket for " + nic + " (" + call + ": " +
                    std::strerror(error) + "); use --transport ring or udp",
                error);
}

}  // namespace

struct XdpSocket::Memory {
  static constexpr std::size_t kBytes = std::size_t{kChunks} * kChunkBytes;

  Memory()
      : bytes(static_cast<std::byte*>(
            ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0))) {}
  ~Memory() {
    if (bytes != MAP_FAILED) ::munmap(bytes, kBytes);
  }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;

  // With the kernel, which locks it; `nic`: for errors. Throws IoError.
  xsk_umem* share(const std::string& nic, xsk_ring_prod& fill, xsk_ring_cons& completed) const {
    if (bytes == MAP_FAILED) xdp_failed(nic, "mmap", errno);
    const xsk_umem_config config{.fill_size = kReceiveSlots,
                                 .comp_size = kSendSlots,
                                 .frame_size = kChunkBytes,
                                 .frame_headroom = 0,
                                 .flags = 0};
    xsk_umem* umem = nullptr;
    const int result = ::xsk_umem__create(&umem, bytes, kBytes, &fill, &completed, &config);
    if (result < 0) xdp_failed(nic, "setsockopt XDP_UMEM_REG", -result);
    return umem;
  }

  std::byte* bytes;
};

void XdpSocket::require_memory() {
  const Memory memory;
  xsk_ring_prod fill{};
  xsk_ring_cons completed{};
  ::xsk_umem__delete(memory.share("any network card", fill, completed));
}

XdpSocket::XdpSocket(const std::string& nic, std::uint32_t queue, bool may_wait)
    : memory_(std::make_unique<Memory>()) {
  umem_ = memory_->share(nic, fill_, completed_);
  // Which the library leaves out: a program that the application starts would keep the queue.
  ::fcntl(::xsk_umem__fd(umem_), F_SETFD, FD_CLOEXEC);
  try {
    open(nic, queue, may_wait);
  } catch (const IoError&) {
    ::xsk_umem__delete(umem_);
    throw;
  }
  std::vector<std::uint64_t> chunks(kReceiveChunks);
  for (std::uint32_t i = 0; i < kReceiveChunks; ++i) chunks[i] = std::uint64_t{i} * kChunkBytes;
  give_to_kernel(chunks);
  for (std::uint32_t i = kReceiveChunks; i < kChunks; ++i) {
    free_.push_back(std::uint64_t{i} * kChunkBytes);
  }
  frames_.reserve(kBatch);
  lent_.reserve(kBatch);
}

// Without a program of the library: it would take all frames of the queue.
void XdpSocket::open(const std::string& nic, std::uint32_t queue, bool may_wait) {
  xsk_socket_config config{};
  config.rx_size = kReceiveSlots;
  config.tx_size = kSendSlots;
  config.libxdp_flags = XSK_LIBXDP_FLAGS__INHIBIT_PROG_LOAD;
  config.bind_flags = XDP_USE_NEED_WAKEUP;
  const TimePoint until = now() + (may_wait ? kMostTakingDown : Duration::zero());
  const auto create = [&] {
    return ::xsk_socket__create(&socket_, nic.c_str(), queue, umem_, &arrived_, &leaving_, &config);
  };
  int result = create();
  while (result == -EBUSY && now() < until) {
    std::this_thread::sleep_for(kTryAgain);
    result = create();
  }
  if (result == -EBUSY) {
    throw IoError("receive queue " + std::to_string(queue) + " of " + nic +
                      " is taken by another AF_XDP socket; end it, or use --transport ring or udp",
                  EBUSY);
  }
  if (result < 0) xdp_failed(nic, "bind AF_XDP", -result);
  ::fcntl(native_handle(), F_SETFD, FD_CLOEXEC);
  // What cannot be had makes fewer packets leave at a time.
  const int wanted = kXdpSendBufferBytes;
  if (::setsockopt(native_handle(), SOL_SOCKET, SO_SNDBUFFORCE, &wanted, sizeof wanted) != 0) {
    ::setsockopt(native_handle(), SOL_SOCKET, SO_SNDBUF, &wanted, sizeof wanted);
  }
}

XdpSocket::~XdpSocket() {
  ::xsk_socket__delete(socket_);
  ::xsk_umem__delete(umem_);
}

int XdpSocket::native_handle() const { return ::xsk_socket__fd(socket_); }

void XdpSocket::give_to_kernel(std::span<const std::uint64_t> chunks) {
  std::uint32_t slot = 0;
  const auto count = static_cast<std::uint32_t>(chunks.size());
  // There is a slot for every chunk.
  if (count == 0 || ::xsk_ring_prod__reserve(&fill_, count, &slot) != count) return;
  for (const std::uint64_t chunk : chunks) *::xsk_ring_prod__fill_addr(&fill_, slot++) = chunk;
  ::xsk_ring_prod__submit(&fill_, count);
}

std::span<const XdpSocket::Frame> XdpSocket::receive() {
  give_to_kernel(lent_);
  lent_.clear();
  frames_.clear();
  std::uint32_t slot = 0;
  const std::uint32_t count = ::xsk_ring_cons__peek(&arrived_, kBatch, &slot);
  const TimePoint at = now();
  for (std::uint32_t i = 0; i < count; ++i) {
    const xdp_desc& frame = *::xsk_ring_cons__rx_desc(&arrived_, slot + i);
    const std::uint64_t chunk = frame.addr - frame.addr % kChunkBytes;
    const std::uint64_t offset = frame.addr - chunk;
    if (chunk >= Memory::kBytes) continue;
    lent_.push_back(chunk);
    if (offset < sizeof(XdpStamp) || frame.len > kChunkBytes - offset) continue;
    std::byte* bytes = memory_->bytes + frame.addr;
    Frame out{.bytes = {bytes, frame.len}};
    XdpStamp stamp = 0;
    std::memcpy(&stamp, bytes - sizeof stamp, sizeof stamp);
    // The next frame in this chunk may come without.
    std::memset(bytes - sizeof stamp, 0, sizeof stamp);
    const TimePoint stamped{Duration{static_cast<std::int64_t>(stamp)}};
    if (stamped <= at && at - stamped <= kOldest) out.stamp = stamped;
    frames_.push_back(out);
  }
  if (count > 0) ::xsk_ring_cons__release(&arrived_, count);
  return frames_;
}

std::uint64_t XdpSocket::take_drops() {
  xdp_statistics stats{};
  socklen_t size = sizeof stats;
  if (::getsockopt(native_handle(), SOL_XDP, XDP_STATISTICS, &stats, &size) != 0) return 0;
  // Since the socket was opened; the second is counted by kernels from 5.9 on.
  const std::uint64_t drops = stats.rx_dropped + stats.rx_ring_full;
  return drops - std::exchange(drops_, drops);
}

void XdpSocket::take_back_sent() {
  std::uint32_t slot = 0;
  const std::uint32_t count = ::xsk_ring_cons__peek(&completed_, kSendSlots, &slot);
  if (count == 0) return;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint64_t addr = *::xsk_ring_cons__comp_addr(&completed_, slot + i);
    const std::uint64_t chunk = addr - addr % kChunkBytes;
    if (chunk < Memory::kBytes) free_.push_back(chunk);
  }
  ::xsk_ring_cons__release(&completed_, count);
}

std::span<std::byte> XdpSocket::reserve() {
  if (free_.empty()) take_back_sent();
  if (free_.empty()) return {};
  return {memory_->bytes + free_.back(), kChunkBytes};
}

void XdpSocket::commit(std::size_t bytes) {
  std::uint32_t slot = 0;
  // There is a slot for every chunk.
  if (::xsk_ring_prod__reserve(&leaving_, 1, &slot) != 1) return;
  xdp_desc& frame = *::xsk_ring_prod__tx_desc(&leaving_, slot);
  frame = {.addr = free_.back(), .len = static_cast<std::uint32_t>(bytes), .options = 0};
  free_.pop_back();
  ::xsk_ring_prod__submit(&leaving_, 1);
}

// In copy mode the kernel takes some packets a call, and says whether it was all of them: EAGAIN
// stands for more to do as well as for no room.
int XdpSocket::flush() {
  for (;;) {
    if (::xsk_ring_prod__needs_wakeup(&leaving_) == 0) return 0;
    const std::uint32_t before = __atomic_load_n(leaving_.consumer, __ATOMIC_ACQUIRE);
    if (::sendto(native_handle(), nullptr, 0, MSG_DONTWAIT, nullptr, 0) >= 0) return 0;
    const int error = errno;
    const std::uint32_t after = __atomic_load_n(leaving_.consumer, __ATOMIC_ACQUIRE);
    if (error == EINTR) continue;
    if ((error != EAGAIN && error != EBUSY) || after == before) return error;
  }
}

bool XdpSocket::needs_flush() const {
  return ::xsk_ring_prod__needs_wakeup(&leaving_) != 0 &&
         __atomic_load_n(leaving_.consumer, __ATOMIC_ACQUIRE) != *leaving_.producer;
}

}  // namespace interneuron::io
