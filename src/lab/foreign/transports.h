// Messages with deadlines over foreign transports: what an application hands to a source and what
// comes out of a sink, and the sources and sinks that there are. All are hosts of a sim::World,
// which owns them; who made them keeps a pointer to hand messages over and to ask for what has
// arrived. Pure; thread-compatible; no errors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/ring.h"
#include "lab/foreign/subflow.h"
#include "lab/sim/host.h"

namespace interneuron::foreign {

// Names a source at the sink; the one who makes the source chooses it.
using ConnectionId = std::uint32_t;

struct Message {
  // Names it at the sink.
  std::uint32_t number = 0;
  std::uint64_t bytes = 0;
  // After this it is of no use to anybody.
  Duration deadline = Duration::max();
};

// As much as a run of any length can send: cross traffic with unlimited demand is one such message.
inline constexpr std::uint64_t kUnlimitedBytes = std::uint64_t{1} << 60U;

// A message that is there whole.
struct Arrival {
  ConnectionId connection = 0;
  std::uint32_t number = 0;
  Duration at{};
};

class MessageSource : public sim::ForeignHost {
 public:
  // Takes a message. World::flush() must follow.
  virtual void send(Duration now, const Message& message) = 0;
};

class MessageSink : public sim::ForeignHost {
 public:
  // The next message that has arrived, in the order of arrival.
  virtual std::optional<Arrival> poll_arrival() = 0;
  // Payload of this connection that the application could read by now, whole messages or not.
  virtual std::uint64_t readable_bytes(ConnectionId connection) const = 0;
};

// No measurement behind this value: it only has to be more messages than can be on their way.
inline constexpr std::uint32_t kRemembered = 256;

// Plain UDP as hosts of the simulation: each message leaves at once in datagrams that fill packets
// of 1500 bytes, and nothing is repaired, paced or acknowledged. A message is there when all of its
// datagrams are. Memory of the sink: a counter for each message of which something is missing,
// among the last kRemembered of a connection.
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
  // How many bytes of the message in front are sent.
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

// TCP and MPTCP as hosts of the simulation: a source that writes messages into one ordered stream,
// and a sink that serves any number of them. With one path it is TCP; with several each has a
// subflow, new pieces go over the one with the lowest round trip that has room, and pieces of a
// subflow whose retransmission timeout ran out go over others, too (RFC 8684, section 3.3.6).
// Subflows have a congestion control each, uncoupled, as upstream Linux has them.
//
// The source is a careful application of live data: it writes no further ahead than the window
// allows, and of the messages that wait for that it keeps the newest, while its deadline has not
// passed. One that was begun is carried to its end, since a stream cannot be cut. Memory: two
// messages and what is in flight.
class TcpSource final : public MessageSource {
 public:
  struct Path {
    LinkId link{};
    // Where the sink is over it.
    Address to{};
  };
  using MakeControl = std::function<std::unique_ptr<CongestionControl>()>;
  // At least one path. `ecn` is set on what is sent.
  TcpSource(ConnectionId connection, const std::vector<Path>& paths,
            const MakeControl& make_control, sim::Ecn ecn = sim::Ecn::kNotEct);

  void send(Duration now, const Message& message) override;
  void handle_packet(Duration now, const sim::ForeignPacket& packet) override;
  void handle_timeout(Duration now) override;
  std::optional<sim::ForeignPacket> poll_transmit(Duration now) override;
  std::optional<Duration> next_timeout(Duration now) const override;

  const SubflowSender& subflow(std::size_t i) const { return subflows_[i].sender; }

 private:
  struct Subflow {
    Path path;
    SubflowSender sender;
    std::deque<Piece> from_others;
  };

  void drop_expired(Duration now);
  bool has_new() const { return begun_ || newest_; }
  Subflow* best_with_room(Duration now);
  Piece next_piece();
  sim::ForeignPacket packet(const Subflow& subflow, DataSegment segment) const;

  ConnectionId connection_;
  sim::Ecn ecn_;
  std::vector<Subflow> subflows_;
  // The message of which `written_` bytes are in the stream, and the one that comes next.
  std::optional<Message> begun_;
  std::optional<Message> newest_;
  std::uint64_t written_ = 0;
  std::uint64_t offset_ = 0;
};

class TcpSink final : public MessageSink {
 public:
  std::optional<Arrival> poll_arrival() override;
  std::uint64_t readable_bytes(ConnectionId connection) const override;
  void handle_packet(Duration now, const sim::ForeignPacket& packet) override;
  void handle_timeout(Duration now) override;
  std::optional<sim::ForeignPacket> poll_transmit(Duration now) override;
  std::optional<Duration> next_timeout(Duration now) const override;

 private:
  struct Subflow {
    LinkId link{};
    Address from{};
    SubflowReceiver receiver;
  };
  struct Connection {
    std::vector<Subflow> subflows;
    StreamReceiver stream;
  };

  Subflow& subflow(Connection& connection, const sim::ForeignPacket& packet);
  void plan(ConnectionId id, const Connection& connection);

  std::map<ConnectionId, Connection> connections_;
  // Connections that may have something to acknowledge now, and when others have.
  std::vector<ConnectionId> ready_;
  std::map<ConnectionId, Duration> timers_;
  Ring<Arrival> arrivals_;
};

}  // namespace interneuron::foreign
