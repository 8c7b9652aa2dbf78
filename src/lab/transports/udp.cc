// Plain UDP on both ends, over one modem or over each of several.
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <thread>

#include "app/process/signals.h"
#include "interneuron/sizes.h"
#include "lab/transports/ends.h"
#include "lab/transports/pieces.h"
#include "lab/transports/sockets.h"
#include "lab/transports/timetable.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;

// Datagrams fill the MTU of an Ethernet.
constexpr std::size_t kDatagram = 1500 - kIpUdpBytes;
// How often a receiver looks whether a signal has come.
constexpr Duration kUdpLook = 100ms;

// Over one modem after the other, as an application would: a copy of 128 KiB is handed to the
// kernel in less than a millisecond.
void send_pieces(std::span<const io::FileDescriptor> sockets, const MessageHead& head) {
  Pieces pieces(head, kDatagram);
  for (const io::FileDescriptor& socket : sockets) {
    for (std::uint32_t place = 0; place < pieces.count(); ++place) {
      const ByteView piece = pieces.piece(place);
      // What the kernel does not take is lost, as it would be in the network.
      ::send(socket.get(), piece.data(), piece.size(), MSG_NOSIGNAL);
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
    process::SignalWatch::check();
    std::vector<TimePoint>& begun = record.begun[due.vehicle];
    const MessageHead head{static_cast<std::uint32_t>(due.vehicle),
                           static_cast<std::uint32_t>(begun.size()),
                           static_cast<std::uint32_t>(traffic.variant_bytes.front())};
    begun.push_back(io::now());
    send_pieces(sockets, head);
  }
  process::SignalWatch::sleep(begin + traffic.length + traffic.deadline - io::now());
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
  while (process::SignalWatch::last() == 0) {
    if (!wait_for(polled, io::now() + kUdpLook)) continue;
    for (;;) {
      const ssize_t size = ::recv(socket.get(), datagram.data(), datagram.size(), 0);
      if (size < 0) break;
      const ByteView piece = ByteView(datagram).first(static_cast<std::size_t>(size));
      if (const auto whole = assembly.take(piece)) reception.arrived(*whole, 0, io::now());
    }
  }
}

}  // namespace interneuron::transports
