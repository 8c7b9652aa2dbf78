// Cross traffic: connections of the kernel's TCP that always have something to send, and the end
// that reads them.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <vector>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/sockets.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;

constexpr Duration kCrossLook = 100ms;
// Between two samples of what was read: far finer than the seconds over which shares are told.
constexpr Duration kSampleStep = 10ms;
constexpr std::size_t kChunkBytes = std::size_t{64} * 1024;
using Chunk = std::array<std::byte, kChunkBytes>;

// Reads what is there and returns how much; the connection stays where it is when it has ended.
std::uint64_t drain(int fd) {
  Chunk chunk;
  std::uint64_t out = 0;
  for (;;) {
    const ssize_t size = ::recv(fd, chunk.data(), chunk.size(), 0);
    if (size <= 0) return out;
    out += static_cast<std::uint64_t>(size);
  }
}

}  // namespace

void send_cross(const Order& order) {
  std::vector<io::FileDescriptor> sockets;
  std::vector<pollfd> polled;
  for (const CrossFlow& flow : order.cross) {
    sockets.push_back(open_socket(IPPROTO_TCP));
    control_congestion(sockets.back(), flow.control);
    bind_to(sockets.back(), flow.modem.vehicle_address, 0);
    connect_to(sockets.back(), flow.modem.road_address, kCrossPort);
    polled.push_back({sockets.back().get(), POLLOUT, 0});
  }
  const Chunk chunk{};
  while (process::SignalWatch::last() == 0) {
    if (!wait_for(polled, io::now() + kCrossLook)) continue;
    for (const pollfd& p : polled) {
      if (p.revents == 0) continue;
      const ssize_t taken = ::send(p.fd, chunk.data(), chunk.size(), MSG_NOSIGNAL);
      if (taken >= 0 || errno == EAGAIN || errno == EINTR) continue;
      throw process::Failure(process::kFailed, "a flow of cross traffic has ended");
    }
  }
}

void receive_cross(const Order& order, const Ready& ready, CrossRecord& record) {
  const io::FileDescriptor listener = open_socket(IPPROTO_TCP);
  bind_to(listener, "0.0.0.0", kCrossPort);
  if (::listen(listener.get(), SOMAXCONN) != 0) {
    throw process::Failure(process::kFailed, "listen failed");
  }
  ready();
  std::vector<io::FileDescriptor> flows;
  std::uint64_t bytes = 0;
  while (process::SignalWatch::last() == 0) {
    std::vector<pollfd> polled;
    // The listener first, until all flows are there.
    polled.push_back({flows.size() < order.cross.size() ? listener.get() : -1, POLLIN, 0});
    for (const io::FileDescriptor& flow : flows) polled.push_back({flow.get(), POLLIN, 0});
    if (!wait_for(polled, io::now() + kCrossLook)) continue;
    for (std::size_t i = 1; i < polled.size(); ++i) {
      if (polled[i].revents != 0) bytes += drain(polled[i].fd);
    }
    const TimePoint now = io::now();
    if (record.samples.empty() || now - record.samples.back().at >= kSampleStep) {
      record.samples.push_back({now, bytes});
    }
    if (polled.front().revents == 0) continue;
    const int fd = ::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0) flows.emplace_back(fd);
  }
}

}  // namespace interneuron::transports
