// TCP and MPTCP as hosts of the simulation: a source that writes messages into one ordered stream,
// and a sink that serves any number of them. With one path it is TCP; with several each has a
// subflow, new pieces go over the one with the lowest round trip that has room, and pieces of a
// subflow whose retransmission timeout ran out go over others, too (RFC 8684, section 3.3.6).
// Subflows have a congestion control each, uncoupled, as upstream Linux has them.
//
// The source is a careful application of live data: it writes no further ahead than the window
// allows, and of the messages that wait for that it keeps the newest, while its deadline has not
// passed. One that was begun is carried to its end, since a stream cannot be cut. Memory: two
// messages and what is in flight. Pure; thread-compatible; no errors.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "core/base/ring.h"
#include "lab/foreign/message.h"
#include "lab/foreign/stream_receiver.h"
#include "lab/foreign/subflow_receiver.h"
#include "lab/foreign/subflow_sender.h"

namespace interneuron::foreign {

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
