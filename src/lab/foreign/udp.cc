#include "lab/foreign/transports.h"

#include <algorithm>

#include "interneuron/sizes.h"
#include "lab/foreign/segment.h"

namespace interneuron::foreign {
namespace {

constexpr std::uint64_t kMostPayload = 1500 - kIpv4UdpBytes;

struct Datagram {
  ConnectionId connection = 0;
  std::uint32_t message = 0;
  // How long the whole message is, and this part of it.
  std::uint64_t message_bytes = 0;
  std::uint64_t bytes = 0;
};

}  // namespace

void UdpSource::send(Duration, const Message& message) { waiting_.push_back(message); }

std::optional<sim::ForeignPacket> UdpSource::poll_transmit(Duration) {
  if (waiting_.empty()) return std::nullopt;
  const Message& message = waiting_.front();
  const std::uint64_t bytes = std::min(kMostPayload, message.bytes - sent_);
  const Datagram datagram{connection_, message.number, message.bytes, bytes};
  sent_ += bytes;
  if (sent_ == message.bytes) {
    waiting_.pop_front();
    sent_ = 0;
  }
  return sim::ForeignPacket{link_, to_, static_cast<std::size_t>(bytes) + kIpv4UdpBytes,
                            sim::Ecn::kNotEct, packed(datagram)};
}

void UdpSink::handle_packet(Duration now, const sim::ForeignPacket& packet) {
  const auto datagram = unpacked<Datagram>(packet.bytes);
  Connection& connection = connections_[datagram.connection];
  connection.received += datagram.bytes;
  auto& missing = connection.missing;
  const auto it = missing.try_emplace(datagram.message, datagram.message_bytes).first;
  it->second -= datagram.bytes;
  if (it->second == 0) {
    arrivals_.push_back({datagram.connection, datagram.message, now});
    missing.erase(it);
  }
  while (!missing.empty() && missing.begin()->first + kRemembered < datagram.message) {
    missing.erase(missing.begin());
  }
}

std::optional<Arrival> UdpSink::poll_arrival() {
  if (arrivals_.empty()) return std::nullopt;
  const Arrival arrival = arrivals_.front();
  arrivals_.pop_front();
  return arrival;
}

std::uint64_t UdpSink::readable_bytes(ConnectionId connection) const {
  const auto it = connections_.find(connection);
  return it == connections_.end() ? 0 : it->second.received;
}

}  // namespace interneuron::foreign
