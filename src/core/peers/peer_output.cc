// What a peer is sent: feedback over whichever path is fastest, and probes and data path by path.
#include <algorithm>
#include <utility>

#include "core/peers/peer.h"

namespace interneuron {

wire::PacketHeader Peer::header(TimePoint now, const Path& path, wire::PacketType type,
                                std::uint64_t number) const {
  return {type,           path.id(), wire::kClearEpoch,
          identity_.self, number,    wire::send_stamp(session_time(now))};
}

// The fastest path that may carry feedback about all paths; of those but `first`, over which the
// same is told, the fastest that may carry a copy.
const Path* Peer::reporter(const Path* first) const {
  const std::size_t size = wire::feedback_bytes(paths_.size()) + kIpUdpBytes;
  const Path* best = nullptr;
  // A path whose delay is not known yet ranks behind those that were measured, and so does one that
  // is suspected.
  const auto rank = [](const Path& p) {
    const Duration d = p.estimator.one_way();
    return std::pair(p.estimator.path() != PathState::kOk,
                     d > Duration::zero() ? d : Duration::max());
  };
  for (const Path& path : paths_) {
    if (!path.estimator.up()) continue;
    if (first != nullptr && (&path == first || !path.may_copy(size))) continue;
    if (best == nullptr || rank(path) < rank(*best)) best = &path;
  }
  return best;
}

TransmitParts Peer::send_feedback(TimePoint now, Path& path, std::span<const Path> about,
                                  std::span<std::byte> buffer) {
  wire::Feedback feedback;
  feedback.u = now.time_since_epoch().count();
  feedback.echo = identity_.session;
  feedback.features = wire::kDecodesWindows;
  for (const Path& p : about) feedback.reports.push_back(p.report(now));
  const bool about_all = about.size() == paths_.size();
  receipts_.tell(now, about_all, feedback);
  if (about_all && receipts_.has_untold()) feedback_.again(now);
  const std::uint64_t number = sender_.take_number(now, path.id());
  const std::size_t size = wire::write_feedback(
      buffer, header(now, path, wire::PacketType::kFeedback, number), feedback);
  path.sent_feedback(now);
  return {path.nic().link, path.address(), size};
}

// A path whose way back stalls looks as if the way there did, and so would all paths that it
// reports of. So another path that messages come over tells the same.
std::optional<TransmitParts> Peer::poll_copy(TimePoint now, std::span<std::byte> buffer) {
  const auto link = std::exchange(copy_over_, std::nullopt);
  Path* path = link ? find(*link) : nullptr;
  if (path == nullptr) return std::nullopt;
  const TransmitParts copy = send_feedback(now, *path, paths_, buffer);
  path->sent_copy(copy.size() + kIpUdpBytes);
  return copy;
}

// Before all else: until it is there the peer sends nothing to this address.
std::optional<TransmitParts> Peer::poll_token(TimePoint now, std::span<std::byte> buffer) {
  for (Path& path : paths_) {
    const auto token = path.take_token();
    if (!token) continue;
    const std::uint64_t number = sender_.take_number(now, path.id());
    const std::size_t size =
        wire::write_token(buffer, header(now, path, wire::PacketType::kToken, number), *token);
    return TransmitParts{path.nic().link, path.address(), size};
  }
  return std::nullopt;
}

std::optional<TransmitParts> Peer::poll_feedback(TimePoint now, std::span<std::byte> buffer) {
  if (auto token = poll_token(now, buffer)) return token;
  if (auto copy = poll_copy(now, buffer)) return copy;
  const Path* over = feedback_.is_due(now) ? reporter() : nullptr;
  if (over != nullptr) {
    feedback_.sent(now);
    for (Path& p : paths_) p.receiver.reported();
    const Path* second = reporter(over);
    if (second != nullptr) copy_over_ = second->id();
    return send_feedback(now, *find(over->id()), paths_, buffer);
  }
  for (Path& path : paths_) {
    if (path.heartbeat_due(now)) return send_feedback(now, path, {&path, 1}, buffer);
  }
  return std::nullopt;
}

TransmitParts Peer::send_probe(TimePoint now, Path& path, std::span<std::byte> buffer) {
  const std::size_t size = path.datagram();
  const std::uint64_t number = sender_.take_number(now, path.id(), size + kIpUdpBytes);
  wire::write_probe(buffer, header(now, path, wire::PacketType::kProbe, number), size);
  path.sent_probe(now, number);
  return {path.nic().link, path.address(), size, {}, 0, path.ecn_bits()};
}

TransmitParts Peer::send_mtu_probe(TimePoint now, Path& path, std::size_t size,
                                   std::span<std::byte> buffer) {
  const std::uint64_t number = sender_.take_mtu_probe_number(now, path.id(), size + kIpUdpBytes);
  wire::write_probe(buffer, header(now, path, wire::PacketType::kProbe, number), size);
  path.sent_mtu_probe(now, number);
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
    path.sent_data(now);
    return TransmitParts{path.nic().link, path.address(), size, {}, 0, path.ecn_bits()};
  }
  const wire::DataEnds ends =
      wire::write_data_ends(buffer, header(now, path, wire::PacketType::kData, piece->number),
                            piece->fragment, piece->bytes.header);
  const TransmitParts parts{path.nic().link, path.address(),  ends.head,   piece->bytes.payload,
                            ends.tail,       path.ecn_bits(), piece->round};
  path.sent_data(now);
  return parts;
}

std::optional<TransmitParts> Peer::poll(TimePoint now, LinkId nic, std::span<std::byte> buffer) {
  for (Path& path : paths_) {
    if (path.nic().link != nic) continue;
    if (const auto size = path.mtu_probe_due()) return send_mtu_probe(now, path, *size, buffer);
    if (path.probe_due(now)) return send_probe(now, path, buffer);
    if (auto transmit = poll_data(now, path, buffer)) return transmit;
  }
  return std::nullopt;
}

MessageId Peer::send(TimePoint now, const flow::Sender::Times& times, wire::MessageBytes message,
                     std::span<const LinkId> paths, const flow::PathSet& repairs,
                     wire::MessageKind kind, const flow::Protection& protection) {
  note_activity(now);
  refresh(now);
  if (kind == wire::MessageKind::kPlain) settlements_.open();
  over_.assign(paths.begin(), paths.end());
  return sender_.send(now, times, std::move(message), over_, repairs, kind, protection);
}

void Peer::want(TimePoint now, DataRate rate) {
  for (Path& path : paths_) path.probes.want(now, rate);
}

}  // namespace interneuron
