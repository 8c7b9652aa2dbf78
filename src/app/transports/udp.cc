// Plain UDP on both ends, over one modem or over each of several.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <thread>
#include <unordered_map>

#include "app/transports/ends.h"
#include "app/transports/sockets.h"
#include "app/transports/timetable.h"
#include "host/io/steady_clock.h"
#include "host/process/signals.h"
#include "interneuron/sizes.h"

namespace interneuron::cli {
namespace {

using namespace std::chrono_literals;

// Datagrams fill the MTU of an Ethernet; each begins with the head of its message and its own place
// in it, with the number of datagrams that the message has in the lower half.
constexpr std::size_t kDatagram = 1500 - kIpUdpBytes;
constexpr std::size_t kPieceHead = kMessageHeadBytes + 4;
constexpr std::size_t kShare = kDatagram - kPieceHead;
constexpr std::uint32_t kHalf = 16;
constexpr std::uint32_t kLowerHalf = 0xffff;
static_assert(kMaxMessageBytes / kShare < kLowerHalf);
// How often a receiver looks whether a signal has come.
constexpr Duration kLook = 100ms;

// Over one modem after the other, as an application would: a copy of 128 KiB is handed to the
// kernel in less than a millisecond.
void send_pieces(std::span<const io::FileDescriptor> sockets, const MessageHead& head) {
  const auto pieces = static_cast<std::uint32_t>((head.bytes + kShare - 1) / kShare);
  std::array<std::byte, kDatagram> datagram{};
  write_head(datagram.data(), head);
  for (const io::FileDescriptor& socket : sockets) {
    std::size_t left = head.bytes;
    for (std::uint32_t piece = 0; piece < pieces; ++piece) {
      const std::size_t share = std::min(left, kShare);
      head_detail::put(datagram.data() + kMessageHeadBytes, piece << kHalf | pieces);
      // What the kernel does not take is lost, as it would be in the network.
      ::send(socket.get(), datagram.data(), kPieceHead + share, MSG_NOSIGNAL);
      left -= share;
    }
  }
}

std::vector<io::FileDescriptor> connected(const Order& order) {
  std::vector<io::FileDescriptor> out;
  for (const Modem& modem : order.modems) {
    io::FileDescriptor& socket = out.emplace_back(open_socket(IPPROTO_UDP));
    enlarge_buffers(socket);
    bind_to(socket, modem.vehicle_address, 0);
    connect_to(socket, modem.road_address, kLoadPort);
  }
  return out;
}

// A message of which datagrams are there. A whole one stays until the end of the run, so that
// copies over other modems are known: one bit for each of its datagrams.
struct Partial {
  std::vector<bool> there;
  std::size_t count = 0;
};

class Assembly {
 public:
  // Takes a datagram; true when its message is whole by it.
  bool take(const MessageHead& head, std::uint32_t place) {
    const std::uint32_t pieces = place & kLowerHalf;
    const std::uint32_t piece = place >> kHalf;
    Partial& partial = messages_[std::uint64_t{head.vehicle} << 32U | head.number];
    if (partial.there.empty()) partial.there.resize(pieces);
    if (piece >= partial.there.size() || partial.there[piece]) return false;
    partial.there[piece] = true;
    return ++partial.count == partial.there.size();
  }

 private:
  // By vehicle and number.
  std::unordered_map<std::uint64_t, Partial> messages_;
};

}  // namespace

VehiclesRecord send_udp(const Order& order, const Begin& ready) {
  const Traffic& traffic = order.traffic;
  const std::vector<io::FileDescriptor> sockets = connected(order);
  const io::PreciseTimers precise;
  VehiclesRecord record;
  record.begun.resize(traffic.vehicles());
  const TimePoint begin = ready();
  for (const Due& due : timetable(traffic)) {
    std::this_thread::sleep_until(
        std::chrono::steady_clock::time_point((begin + due.at).time_since_epoch()));
    SignalWatch::check();
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    const MessageHead head{static_cast<std::uint32_t>(due.vehicle),
                           static_cast<std::uint32_t>(begun.size()),
                           static_cast<std::uint32_t>(traffic.variant_bytes.front())};
    begun.push_back(io::now());
    send_pieces(sockets, head);
  }
  SignalWatch::sleep(begin + traffic.length + traffic.deadline - io::now());
  return record;
}

void receive_udp(const Order& /*order*/, const Ready& ready, Reception& reception) {
  const io::FileDescriptor socket = open_socket(IPPROTO_UDP);
  enlarge_buffers(socket);
  bind_to(socket, "0.0.0.0", kLoadPort);
  ready();
  Assembly assembly;
  std::array<std::byte, kDatagram> datagram{};
  std::array<pollfd, 1> polled{{{socket.get(), POLLIN, 0}}};
  while (SignalWatch::last() == 0) {
    if (!wait_for(polled, io::now() + kLook)) continue;
    for (;;) {
      const ssize_t size = ::recv(socket.get(), datagram.data(), datagram.size(), 0);
      if (size < static_cast<ssize_t>(kPieceHead)) break;
      const auto head = read_head(datagram);
      const std::uint32_t place = head_detail::get(datagram.data() + kMessageHeadBytes);
      if (assembly.take(*head, place)) reception.arrived(*head, 0, io::now());
    }
  }
}

}  // namespace interneuron::cli
