// Plain UDP on both ends.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <thread>
#include <unordered_map>

#include "app/load_testbed/ends.h"
#include "app/load_testbed/sockets.h"
#include "app/load_testbed/timetable.h"
#include "host/io/steady_clock.h"
#include "host/process/signals.h"
#include "interneuron/sizes.h"

namespace interneuron::cli {
namespace {

using namespace std::chrono_literals;

// Datagrams fill the MTU of an Ethernet; each begins with the head of its message and the number of
// datagrams that this has.
constexpr std::size_t kDatagram = 1500 - kIpUdpBytes;
constexpr std::size_t kPieceHead = kMessageHeadBytes + 4;
// How often a receiver looks whether a signal has come.
constexpr Duration kLook = 100ms;

void send_pieces(int fd, const MessageHead& head) {
  constexpr std::size_t kShare = kDatagram - kPieceHead;
  const std::size_t pieces = (head.bytes + kShare - 1) / kShare;
  std::array<std::byte, kDatagram> datagram{};
  write_head(datagram.data(), head);
  head_detail::put(datagram.data() + kMessageHeadBytes, static_cast<std::uint32_t>(pieces));
  for (std::size_t left = head.bytes; left > 0;) {
    const std::size_t share = std::min(left, kShare);
    // What the kernel does not take is lost, as it would be in the network.
    ::send(fd, datagram.data(), kPieceHead + share, MSG_NOSIGNAL);
    left -= share;
  }
}

}  // namespace

VehiclesRecord send_udp(const Order& order, const Begin& ready) {
  const load::Scenario& s = order.scenario;
  const io::FileDescriptor socket = open_socket(IPPROTO_UDP);
  enlarge_buffers(socket);
  bind_to(socket, order.modems.front().vehicle_address, 0);
  connect_to(socket, order.modems.front().road_address, kLoadPort);
  const io::PreciseTimers precise;
  VehiclesRecord record;
  record.begun.resize(s.vehicles);
  const TimePoint begin = ready();
  for (const Due& due : timetable(s)) {
    std::this_thread::sleep_until(
        std::chrono::steady_clock::time_point((begin + due.at).time_since_epoch()));
    SignalWatch::check();
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    const MessageHead head{static_cast<std::uint32_t>(due.vehicle),
                           static_cast<std::uint32_t>(begun.size()),
                           static_cast<std::uint32_t>(s.message_bytes)};
    begun.push_back(io::now());
    send_pieces(socket.get(), head);
  }
  SignalWatch::sleep(begin + s.length + s.deadline - io::now());
  return record;
}

void receive_udp(const Order& /*order*/, const Ready& ready, Reception& reception) {
  const io::FileDescriptor socket = open_socket(IPPROTO_UDP);
  enlarge_buffers(socket);
  bind_to(socket, "0.0.0.0", kLoadPort);
  ready();
  // Of messages that are not whole yet, by vehicle and number: the datagrams that are there.
  std::unordered_map<std::uint64_t, std::uint32_t> there;
  std::array<std::byte, kDatagram> datagram{};
  std::array<pollfd, 1> polled{{{socket.get(), POLLIN, 0}}};
  while (SignalWatch::last() == 0) {
    if (!wait_for(polled, io::now() + kLook)) continue;
    for (;;) {
      const ssize_t size = ::recv(socket.get(), datagram.data(), datagram.size(), 0);
      if (size < static_cast<ssize_t>(kPieceHead)) break;
      const auto head = read_head(datagram);
      const std::uint32_t pieces = head_detail::get(datagram.data() + kMessageHeadBytes);
      const std::uint64_t key = std::uint64_t{head->vehicle} << 32U | head->number;
      if (++there[key] < pieces) continue;
      there.erase(key);
      reception.arrived(*head, 0, io::now());
    }
  }
}

}  // namespace interneuron::cli
