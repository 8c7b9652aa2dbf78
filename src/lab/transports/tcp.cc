// TCP and MPTCP of the kernel on both ends.
#include <linux/mptcp.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <limits>
#include <optional>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/sockets.h"
#include "lab/transports/timetable.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;

constexpr Duration kTcpPatience = 30s;
constexpr Duration kTcpLook = 100ms;
// The most that waits in the kernel beyond the window, and so how finely the application writes. No
// measurement behind this value: it takes 3 ms at 20 Mbit/s, little of a deadline of 100 ms.
constexpr int kUnsentBytes = 8 * 1024;
// The first bytes of a connection, which are no message: MPTCP opens its second subflow only when
// data have crossed the first one.
constexpr std::uint32_t kGreeting = std::numeric_limits<std::uint32_t>::max();

int protocol_of(const Order& order) {
  return order.transport.kind == Kind::kMptcp ? IPPROTO_MPTCP : IPPROTO_TCP;
}

// One vehicle's end of its connection.
class Source {
 public:
  Source(const Order& order, std::uint32_t vehicle)
      : traffic_(order.traffic), vehicle_(vehicle), socket_(open_socket(protocol_of(order))) {
    control_congestion(socket_, order.transport.mode);
    const int on = 1;
    ::setsockopt(socket_.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    ::setsockopt(socket_.get(), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsentBytes, sizeof kUnsentBytes);
    bind_to(socket_, order.modems.front().vehicle_address, 0);
    connect_to(socket_, order.modems.front().road_address, kLoadPort);
  }

  int fd() const { return socket_.get(); }
  bool has_data() const { return offset_ < current_.size() || waiting_; }

  void greet() {
    check_connected(socket_);
    current_ = message_of(vehicle_, kGreeting, kMessageHeadBytes);
    write(io::now());
  }

  // Takes the place of a message that waits.
  void hand_over(std::uint32_t number, TimePoint now) {
    waiting_ = Waiting{number, now + traffic_.deadline};
  }

  // The socket takes more. Throws Failure when the connection has ended.
  void write(TimePoint now) {
    if (offset_ == current_.size() && !begin_next(now)) return;
    const std::size_t size =
        std::min(current_.size() - offset_, static_cast<std::size_t>(kUnsentBytes));
    const ssize_t taken = ::send(fd(), current_.data() + offset_, size, MSG_NOSIGNAL);
    if (taken > 0) offset_ += static_cast<std::size_t>(taken);
    if (taken < 0 && errno != EAGAIN && errno != EINTR) {
      throw process::Failure(process::kFailed, "a connection to the roadside unit has ended");
    }
  }

  // Whether MPTCP has subflows beside the first one.
  bool has_more_subflows() const {
    mptcp_info info{};
    socklen_t size = sizeof info;
    return ::getsockopt(fd(), SOL_MPTCP, MPTCP_INFO, &info, &size) == 0 && info.mptcpi_subflows > 0;
  }

 private:
  struct Waiting {
    std::uint32_t number = 0;
    TimePoint deadline{};
  };

  bool begin_next(TimePoint now) {
    const std::optional<Waiting> next = std::exchange(waiting_, std::nullopt);
    if (!next || next->deadline < now) return false;
    current_ = message_of(vehicle_, next->number, traffic_.variant_bytes.front());
    offset_ = 0;
    return true;
  }

  const Traffic& traffic_;
  std::uint32_t vehicle_;
  io::FileDescriptor socket_;
  // What is being written, and how much of it was.
  Bytes current_;
  std::size_t offset_ = 0;
  std::optional<Waiting> waiting_;
};

void await(std::vector<Source>& sources) {
  const TimePoint patience = io::now() + kTcpPatience;
  for (Source& source : sources) {
    std::array<pollfd, 1> polled{{{source.fd(), POLLOUT, 0}}};
    while (!wait_for(polled, io::now() + kTcpLook)) {
      process::SignalWatch::check();
      if (io::now() > patience)
        throw process::Failure(process::kFailed, "a vehicle cannot connect");
    }
    source.greet();
  }
}

// Writes what is to be written until then.
void write_until(std::vector<Source>& sources, TimePoint until) {
  std::vector<pollfd> polled;
  for (TimePoint now = io::now(); now < until; now = io::now()) {
    process::SignalWatch::check();
    polled.clear();
    for (const Source& source : sources) {
      // A negative descriptor is not looked at.
      polled.push_back({source.has_data() ? source.fd() : -1, POLLOUT, 0});
    }
    if (!wait_for(polled, std::min(until, now + kTcpLook))) continue;
    now = io::now();
    for (std::size_t i = 0; i < sources.size(); ++i) {
      if (polled[i].revents != 0) sources[i].write(now);
    }
  }
}

// The roadside unit's end of a connection.
class Sink {
 public:
  explicit Sink(int fd) : socket_(fd) {}
  int fd() const { return socket_.get(); }

  // Reads what is there; false when the connection has ended or sent what is no message.
  bool read(Reception& reception) {
    for (;;) {
      std::array<std::byte, 64 * 1024> chunk;
      const ssize_t size = ::recv(fd(), chunk.data(), chunk.size(), 0);
      if (size < 0) return errno == EAGAIN || errno == EINTR;
      if (size == 0) return false;
      if (!take(ByteView(chunk).first(static_cast<std::size_t>(size)), reception)) return false;
    }
  }

 private:
  bool take(ByteView bytes, Reception& reception) {
    while (!bytes.empty()) {
      if (have_ < kMessageHeadBytes) {
        const std::size_t part = std::min(bytes.size(), kMessageHeadBytes - have_);
        std::copy_n(bytes.begin(), part, head_bytes_.begin() + static_cast<std::ptrdiff_t>(have_));
        have_ += part;
        bytes = bytes.subspan(part);
        if (have_ < kMessageHeadBytes) return true;
        head_ = *read_head(head_bytes_);
        if (head_.bytes < kMessageHeadBytes || head_.bytes > kMaxMessageBytes) return false;
      }
      const std::size_t part = std::min(bytes.size(), head_.bytes - have_);
      have_ += part;
      bytes = bytes.subspan(part);
      if (have_ < head_.bytes) return true;
      have_ = 0;
      if (head_.number != kGreeting) reception.arrived(head_, 0, io::now());
    }
    return true;
  }

  io::FileDescriptor socket_;
  std::array<std::byte, kMessageHeadBytes> head_bytes_{};
  MessageHead head_;
  // Bytes of the message, with its head, that are there.
  std::size_t have_ = 0;
};

void accept_all(int listener, std::vector<Sink>& sinks) {
  for (;;) {
    const int fd = ::accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) return;
    sinks.emplace_back(fd);
  }
}

}  // namespace

VehiclesRecord send_tcp(const Order& order, const Begin& ready) {
  const Traffic& traffic = order.traffic;
  const io::PreciseTimers precise;
  std::vector<Source> sources;
  for (std::size_t v = 0; v < traffic.vehicles(); ++v) {
    sources.emplace_back(order, static_cast<std::uint32_t>(v));
  }
  await(sources);
  const TimePoint begin = ready();
  write_until(sources, begin);
  if (order.transport.kind == Kind::kMptcp &&
      !std::ranges::all_of(sources, &Source::has_more_subflows)) {
    throw process::Failure(process::kFailed, "MPTCP has opened no second subflow");
  }
  VehiclesRecord record;
  record.begun.resize(traffic.vehicles());
  for (const Due& due : timetable(traffic)) {
    write_until(sources, begin + due.at);
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    const auto number = static_cast<std::uint32_t>(begun.size());
    begun.push_back(io::now());
    sources[due.vehicle].hand_over(number, begun.back());
  }
  write_until(sources, begin + traffic.length + traffic.deadline);
  return record;
}

void receive_tcp(const Order& order, const Ready& ready, Reception& reception) {
  const io::FileDescriptor listener = open_socket(protocol_of(order));
  bind_to(listener, "0.0.0.0", kLoadPort);
  if (::listen(listener.get(), SOMAXCONN) != 0)
    throw process::Failure(process::kFailed, "listen failed");
  ready();
  std::vector<Sink> sinks;
  std::vector<pollfd> polled;
  while (process::SignalWatch::last() == 0) {
    polled = {{listener.get(), POLLIN, 0}};
    for (const Sink& sink : sinks) polled.push_back({sink.fd(), POLLIN, 0});
    if (!wait_for(polled, io::now() + kTcpLook)) continue;
    // Backwards, so that one that ends does not move those that are still to be read.
    for (std::size_t i = sinks.size(); i > 0; --i) {
      if (polled[i].revents == 0 || sinks[i - 1].read(reception)) continue;
      sinks.erase(sinks.begin() + static_cast<std::ptrdiff_t>(i - 1));
    }
    accept_all(listener.get(), sinks);
  }
}

}  // namespace interneuron::transports
