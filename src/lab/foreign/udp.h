// Plain UDP as hosts of the simulation: each message leaves at once in datagrams that fill packets
// of 1500 bytes, and nothing is repaired, paced or acknowledged. A message is there when all of its
// datagrams are. Memory of the sink: a counter for each message of which something is missing,
// among the last kRemembered of a connection. Pure; thread-compatible; no errors.
#pragma once

#include <map>

#include "core/base/ring.h"
#include "lab/foreign/message.h"

namespace interneuron::foreign {

// No measurement behind this value: it only has to be more messages than can be on their way.
inline constexpr std::uint32_t kRemembered = 256;

class UdpSource final : public MessageSource {
 public:
  UdpSource(ConnectionId connection, LinkId link, const Address& to)
      : connection_(connection), link_(link), to_(to) {}

  void send(Duration now, const Message& message) override;
  void handle_packet(Duration, const sim::ForeignPacket&) override {}
  void handle_timeout(Duration) override {}
  std::optional<sim::ForeignPacket> poll_transmit(Duration now) override;
  std::optional<Duration> next_timeout(Duration) const override { return std::nullopt; }

 private:
  ConnectionId connection_;
  LinkId link_;
  Address to_;
  Ring<Message> waiting_;
  // Of the message in front, the bytes sent.
  std::uint64_t sent_ = 0;
};

class UdpSink final : public MessageSink {
 public:
  std::optional<Arrival> poll_arrival() override;
  std::uint64_t readable_bytes(ConnectionId connection) const override;
  void handle_packet(Duration now, const sim::ForeignPacket& packet) override;
  void handle_timeout(Duration) override {}
  std::optional<sim::ForeignPacket> poll_transmit(Duration) override { return std::nullopt; }
  std::optional<Duration> next_timeout(Duration) const override { return std::nullopt; }

 private:
  struct Connection {
    // The bytes that are missing, by message.
    std::map<std::uint32_t, std::uint64_t> missing;
    std::uint64_t received = 0;
  };

  std::map<ConnectionId, Connection> connections_;
  Ring<Arrival> arrivals_;
};

}  // namespace interneuron::foreign
