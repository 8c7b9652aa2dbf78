// What a peer is sent: feedback over whichever path is fastest, and probes and data path by path.
#include <algorithm>
#include <utility>

#include "core/peers/peer.h"

namespace interneuron::peers {

wire::PacketHeader Peer::header(TimePoint now, const Path& path, wire::PacketType type,
                                std::uint64_t number) const {
  return {type,           path.id(), wire::kClearEpoch,
          identity_.self, number,    wire::send_stamp(session_time(now))};
}

TransmitParts Peer::send_feedback(TimePoint now, Path& path, std::span<const Path> about,
                                  std::span<std::byte> buffer) {
  wire::Feedback feedback;
  feedback.u = now.time_since_epoch().count();
  feedback.echo = identity_.session;
  feedback.features = wire::kDecodesWindows;
  for (const Path& p : about) feedback.reports.push_back(p.report(now));
  const bool about_all = about.size() == paths_.size();
  intake_.receipts.tell(now, about_all, feedback);
  // A heartbeat over a slow path that is the only one has told all that there is.
  if (about_all && intake_.feedback.apart() > Duration::zero()) intake_.feedback.sent(now);
  if (about_all && intake_.receipts.has_untold()) intake_.feedback.again(now);
  const std::uint64_t number = sender_.take_number(now, path.id());
  const std::size_t size = wire::write_feedback(
      buffer, header(now, path, wire::PacketType::kFeedback, number), feedback);
  path.sent_feedback(now);
  return {path.nic().link, path.address(), size};
}

// A path whose way back stalls looks as if the way there did, and so would all paths that it
// reports of. So another path that messages come over tells the same.
std::optional<TransmitParts> Peer::poll_copy(TimePoint now, std::span<std::byte> buffer) {
  const auto link = std::exchange(session_.copy_over, std::nullopt);
  Path* path = link ? paths_.find(*link) : nullptr;
  if (path == nullptr) return std::nullopt;
  const TransmitParts copy = send_feedback(now, *path, paths_, buffer);
  path->sent_copy(copy.size() + kIpUdpBytes);
  return copy;
}

std::optional<TransmitParts> Peer::poll_feedback(TimePoint now, std::span<std::byte> buffer) {
  for (Path& path : paths_) {
    // Before all else: until it is there the peer sends nothing to this address.
    const auto token = path.take_token();
    if (!token) continue;
    const std::uint64_t number = sender_.take_number(now, path.id());
    const std::size_t size =
        wire::write_token(buffer, header(now, path, wire::PacketType::kToken, number), *token);
    return TransmitParts{path.nic().link, path.address(), size};
  }
  if (auto copy = poll_copy(now, buffer)) return copy;
  const Path* over = intake_.feedback.is_due(now) ? paths_.reporter() : nullptr;
  if (over != nullptr) {
    intake_.feedback.sent(now);
    for (Path& p : paths_) p.receiver.reported();
    const Path* second = paths_.reporter(over);
    if (second != nullptr) session_.copy_over = second->id();
    return send_feedback(now, *paths_.find(over->id()), paths_, buffer);
  }
  for (Path& path : paths_) {
    if (path.heartbeat_due(now)) return send_feedback(now, path, {&path, 1}, buffer);
  }
  return std::nullopt;
}

TransmitParts Peer::write_probe(TimePoint now, const Path& path, std::uint64_t number,
                                std::size_t size, std::span<std::byte> buffer) const {
  wire::write_probe(buffer, header(now, path, wire::PacketType::kProbe, number), size);
  return {path.nic().link, path.address(), size, {}, 0, path.ecn_bits()};
}

std::optional<TransmitParts> Peer::poll_data(TimePoint now, Path& path,
                                             std::span<std::byte> buffer) {
  const auto piece = sender_.poll(now, path.id());
  if (!piece) return std::nullopt;
  if (piece->window != nullptr) {
    const std::size_t size =
        wire::write_window(buffer, header(now, path, wire::PacketType::kWindow, piece->number),
                           *piece->window, piece->bytes.payload);
    path.sent_data(now, size + kIpUdpBytes);
    return TransmitParts{path.nic().link, path.address(), size, {}, 0, path.ecn_bits()};
  }
  const wire::DataEnds ends =
      wire::write_data_ends(buffer, header(now, path, wire::PacketType::kData, piece->number),
                            piece->fragment, piece->bytes.header);
  const TransmitParts parts{path.nic().link, path.address(),  ends.head,   piece->bytes.payload,
                            ends.tail,       path.ecn_bits(), piece->round};
  path.sent_data(now, parts.size() + kIpUdpBytes);
  return parts;
}

std::optional<TransmitParts> Peer::poll(TimePoint now, LinkId nic, std::span<std::byte> buffer) {
  for (Path& path : paths_) {
    if (path.nic().link != nic) continue;
    if (const auto size = path.mtu_probe_due()) {
      const auto number = sender_.take_mtu_probe_number(now, path.id(), *size + kIpUdpBytes);
      path.sent_mtu_probe(now, number);
      return write_probe(now, path, number, *size, buffer);
    }
    if (path.probe_due(now)) {
      const std::size_t size = path.datagram();
      const auto number = sender_.take_number(now, path.id(), size + kIpUdpBytes);
      path.sent_probe(now, number);
      return write_probe(now, path, number, size, buffer);
    }
    if (auto transmit = poll_data(now, path, buffer)) return transmit;
  }
  return std::nullopt;
}

MessageId Peer::send(TimePoint now, const flow::Sender::Times& times, wire::MessageBytes message,
                     const flow::PathList& paths, const flow::PathSet& repairs,
                     wire::MessageKind kind, const flow::Protection& protection) {
  paths_.note_activity(now);
  refresh(now);
  if (kind == wire::MessageKind::kPlain) settlements_.open();
  return sender_.send(now, times, std::move(message), paths, repairs, kind, protection);
}

}  // namespace interneuron::peers
