#include "lab/foreign/transports.h"

#include <algorithm>
#include <utility>

namespace interneuron::foreign {
namespace {

// The options of SACK take 2 bytes and 8 per block, rounded to words (RFC 2018, section 3).
std::size_t ack_bytes(const AckSegment& ack) {
  return kTcpIpBytes + (ack.sack_count > 0 ? 4 + 8 * ack.sack_count : 0);
}

void keep_earliest(std::optional<Duration>& earliest, const std::optional<Duration>& other) {
  if (other && (!earliest || *other < *earliest)) earliest = other;
}

}  // namespace

TcpSource::TcpSource(ConnectionId connection, const std::vector<Path>& paths,
                     const MakeControl& make_control, sim::Ecn ecn)
    : connection_(connection), ecn_(ecn) {
  for (const Path& path : paths) {
    subflows_.push_back(Subflow{path, SubflowSender(make_control()), {}});
  }
}

void TcpSource::send(Duration, const Message& message) { newest_ = message; }

void TcpSource::handle_packet(Duration now, const sim::ForeignPacket& packet) {
  const auto it =
      std::ranges::find(subflows_, packet.link, [](const Subflow& s) { return s.path.link; });
  if (it != subflows_.end()) it->sender.acknowledged(now, unpacked<AckSegment>(packet.bytes));
}

void TcpSource::handle_timeout(Duration now) {
  for (Subflow& subflow : subflows_) {
    for (const Piece& piece : subflow.sender.handle_timeout(now)) {
      for (Subflow& other : subflows_) {
        if (&other != &subflow) other.from_others.push_back(piece);
      }
    }
  }
}

void TcpSource::drop_expired(Duration now) {
  if (newest_ && newest_->deadline <= now) newest_.reset();
}

Piece TcpSource::next_piece() {
  if (!begun_) begun_ = std::exchange(newest_, std::nullopt);
  Piece piece;
  piece.offset = offset_;
  piece.bytes = static_cast<std::uint32_t>(std::min<std::uint64_t>(kMss, begun_->bytes - written_));
  piece.message = begun_->number;
  written_ += piece.bytes;
  offset_ += piece.bytes;
  piece.ends_message = written_ == begun_->bytes;
  if (piece.ends_message) {
    begun_.reset();
    written_ = 0;
  }
  return piece;
}

TcpSource::Subflow* TcpSource::best_with_room(Duration now) {
  Subflow* best = nullptr;
  for (Subflow& subflow : subflows_) {
    if (!subflow.sender.can_send(now)) continue;
    if (best == nullptr || subflow.sender.rtt() < best->sender.rtt()) best = &subflow;
  }
  return best;
}

sim::ForeignPacket TcpSource::packet(const Subflow& subflow, DataSegment segment) const {
  segment.connection = connection_;
  return {subflow.path.link, subflow.path.to, segment.piece.bytes + kTcpIpBytes, ecn_,
          packed(segment)};
}

std::optional<sim::ForeignPacket> TcpSource::poll_transmit(Duration now) {
  for (Subflow& subflow : subflows_) {
    if (!subflow.sender.can_send(now)) continue;
    if (subflow.sender.has_lost()) return packet(subflow, subflow.sender.send_again(now));
    if (subflow.from_others.empty()) continue;
    const Piece piece = subflow.from_others.front();
    subflow.from_others.pop_front();
    return packet(subflow, subflow.sender.send(now, piece));
  }
  drop_expired(now);
  if (has_new()) {
    Subflow* best = best_with_room(now);
    if (best == nullptr) return std::nullopt;
    return packet(*best, best->sender.send(now, next_piece()));
  }
  for (Subflow& subflow : subflows_) {
    if (subflow.sender.can_send(now)) subflow.sender.application_is_idle();
  }
  return std::nullopt;
}

std::optional<Duration> TcpSource::next_timeout(Duration) const {
  std::optional<Duration> out;
  for (const Subflow& subflow : subflows_) {
    keep_earliest(out, subflow.sender.next_timeout(has_new() || !subflow.from_others.empty()));
  }
  return out;
}

std::optional<Arrival> TcpSink::poll_arrival() {
  if (arrivals_.empty()) return std::nullopt;
  const Arrival arrival = arrivals_.front();
  arrivals_.pop_front();
  return arrival;
}

std::uint64_t TcpSink::readable_bytes(ConnectionId connection) const {
  const auto it = connections_.find(connection);
  return it == connections_.end() ? 0 : it->second.stream.readable_bytes();
}

TcpSink::Subflow& TcpSink::subflow(Connection& connection, const sim::ForeignPacket& packet) {
  const auto it = std::ranges::find(connection.subflows, packet.link, &Subflow::link);
  if (it != connection.subflows.end()) return *it;
  return connection.subflows.emplace_back(Subflow{packet.link, packet.peer, {}});
}

// Notes what the connection waits for.
void TcpSink::plan(ConnectionId id, const Connection& connection) {
  std::optional<Duration> next;
  for (const Subflow& s : connection.subflows) keep_earliest(next, s.receiver.next_timeout());
  timers_.erase(id);
  if (next) timers_.emplace(id, *next);
}

void TcpSink::handle_packet(Duration now, const sim::ForeignPacket& packet) {
  const auto segment = unpacked<DataSegment>(packet.bytes);
  Connection& connection = connections_[segment.connection];
  subflow(connection, packet).receiver.segment(now, segment, packet.ecn == sim::Ecn::kCe);
  connection.stream.add(segment.piece);
  while (const auto message = connection.stream.poll_message()) {
    arrivals_.push_back({segment.connection, *message, now});
  }
  ready_.push_back(segment.connection);
  plan(segment.connection, connection);
}

void TcpSink::handle_timeout(Duration now) {
  for (const auto& [id, at] : timers_) {
    if (at > now) continue;
    for (Subflow& s : connections_[id].subflows) s.receiver.handle_timeout(now);
    ready_.push_back(id);
  }
}

std::optional<sim::ForeignPacket> TcpSink::poll_transmit(Duration) {
  while (!ready_.empty()) {
    Connection& connection = connections_[ready_.back()];
    for (Subflow& s : connection.subflows) {
      const auto ack = s.receiver.poll();
      if (!ack) continue;
      plan(ready_.back(), connection);
      return sim::ForeignPacket{s.link, s.from, ack_bytes(*ack), sim::Ecn::kNotEct, packed(*ack)};
    }
    ready_.pop_back();
  }
  return std::nullopt;
}

std::optional<Duration> TcpSink::next_timeout(Duration) const {
  std::optional<Duration> out;
  for (const auto& timer : timers_) keep_earliest(out, timer.second);
  return out;
}

}  // namespace interneuron::foreign
