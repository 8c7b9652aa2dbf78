#include "endpoint/peer.h"

#include <algorithm>

#include "link/nature.h"

namespace interneuron {
namespace {

// While messages flow, a path's round trip is refreshed this often: two samples per round at 10 Hz.
constexpr Duration kHeartbeat = std::chrono::milliseconds(50);
// Otherwise: three within the silence that makes a path count as down; also keeps carrier NATs open
// (>= 15 s).
constexpr Duration kIdleHeartbeat = std::chrono::milliseconds(300);
constexpr Duration kActive = std::chrono::seconds(5);  // after the last message; chosen
// Feedback after this many packets or this long, whichever is first (transport.md §4.1).
constexpr std::uint32_t kFeedbackPackets = 16;
constexpr Duration kFeedbackDelay = std::chrono::milliseconds(5);
// A gap is reported at once, but not more often than this; chosen.
constexpr Duration kFeedbackSpacing = std::chrono::milliseconds(1);
// The train that measures a path nobody has used yet: 4 ms at 100 Mbit/s; again after a pause if
// nothing came of it.
constexpr std::uint32_t kStartTrainPackets = 32;
constexpr Duration kStartTrainPause = std::chrono::milliseconds(300);
// Until a peer has echoed our session, it gets at most this many times what it sent (RFC 9000
// §8.1).
constexpr std::uint64_t kAmplification = 3;
constexpr std::size_t kIpUdpOverhead = 28;

}  // namespace

Peer::Peer(const Identity& identity, TimePoint now)
    : identity_(identity),
      sender_(
          {.repair = identity.repair,
           .first_message = MessageId{static_cast<std::uint32_t>(
               std::chrono::floor<std::chrono::milliseconds>(now - identity.started).count())}}),
      heard_at_(now),
      active_at_(now),
      feedback_sent_at_(now) {}

Peer::Path* Peer::find(LinkId path) {
  const auto it = std::ranges::find(paths_, path, &Path::id);
  return it == paths_.end() ? nullptr : &*it;
}

const Peer::Path* Peer::find(LinkId path) const {
  const auto it = std::ranges::find(paths_, path, &Path::id);
  return it == paths_.end() ? nullptr : &*it;
}

void Peer::add_path(TimePoint now, LinkId id, LinkId nic, const Address& address,
                    std::size_t max_datagram) {
  if (Path* known = find(id)) {
    if (known->address == address && known->nic == nic) return;
    known->address = address;
    known->nic = nic;
    known->validated = false;
    known->bytes_in = known->bytes_out = 0;
    // The other NIC may carry less.
    known->max_datagram = max_datagram;
    sender_.add_path(id, max_datagram);
    return;
  }
  if (paths_.size() >= wire::kMaxReports) return;
  Path path;
  path.id = id;
  path.nic = nic;
  path.address = address;
  path.max_datagram = max_datagram;
  path.receiver = flow::PathReceiver(id);
  path.heartbeat_at = now;
  path.validated = identity_.connected;
  paths_.push_back(path);
  sender_.add_path(id, max_datagram, first_number(now));
}

// Within one session packet numbers only grow, also when a peer or a path was forgotten and comes
// back: the other side may remember it and would drop smaller ones as duplicates. So numbers begin
// at the microseconds of our life so far, and the numbers of messages at the milliseconds; more
// than that are not sent on average.
std::uint64_t Peer::first_number(TimePoint now) const {
  return 1 + static_cast<std::uint64_t>(
                 std::chrono::floor<std::chrono::microseconds>(now - identity_.started).count());
}

void Peer::remove_nic(TimePoint now, LinkId nic) {
  for (const Path& path : paths_) {
    if (path.nic == nic) sender_.remove_path(now, path.id);
  }
  std::erase_if(paths_, [nic](const Path& path) { return path.nic == nic; });
}

bool Peer::reached_at(LinkId nic, const Address& address) const {
  return std::ranges::any_of(
      paths_, [&](const Path& path) { return path.nic == nic && path.address == address; });
}

void Peer::restart(TimePoint now, SessionId session) {
  identity_.session = session;
  ready_ = false;
  sender_.reset(now);
  reassembler_.reset();
  clock_.reset();
  unreported_ = 0;
  feedback_at_.reset();
  for (Path& path : paths_) {
    path.receiver = flow::PathReceiver(path.id);
    path.estimator = {};
    path.heartbeat_at = now;
    path.train_at.reset();
    path.train_left = 0;
  }
}

// --- input

Peer::Input Peer::handle(TimePoint now, const wire::Packet& packet, std::size_t datagram_bytes) {
  Input input;
  Path& path = *find(packet.header.link);
  path.bytes_in += datagram_bytes;
  const bool is_feedback = packet.header.type == wire::PacketType::kFeedback;
  if (!path.receiver.accept(now, packet.header.number, !is_feedback,
                            datagram_bytes + kIpUdpOverhead)) {
    input.duplicate = true;
    return input;
  }
  heard_at_ = now;
  path.estimator.heard(now);
  if (is_feedback) {
    handle_feedback(now, path, packet.feedback, input);
    return input;
  }
  note_arrival(now, path.receiver.gap());
  if (packet.header.type != wire::PacketType::kData) return input;

  flow::ClockBounds clocks{identity_.self, identity_.session, std::nullopt};
  if (packet.data.fragment.index == 0) clocks.peer_hi_min = clock_.hi_min(now);
  flow::Reassembler::Outcome outcome = reassembler_.add(now, packet.data, clocks);
  if (outcome.result == flow::Reassembler::Result::kRefused) input.refused = true;
  if (outcome.result == flow::Reassembler::Result::kComplete) {
    active_at_ = now;
    input.message = std::move(outcome.message);
  }
  return input;
}

void Peer::note_arrival(TimePoint now, bool gap) {
  ++unreported_;
  TimePoint due = now + kFeedbackDelay;
  if (unreported_ >= kFeedbackPackets) due = now;
  if (gap) due = std::min(due, std::max(now, feedback_sent_at_ + kFeedbackSpacing));
  if (!feedback_at_ || due < *feedback_at_) feedback_at_ = due;
}

void Peer::handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback,
                           Input& input) {
  path.receiver.exchange(now, PeerTime{Duration{feedback.u}});
  if (feedback.echo != identity_.self)
    return;  // meant for an earlier life of ours, or it has not heard us
  path.validated = true;
  if (!ready_) input.became_ready = ready_ = true;
  for (const wire::LinkReport& report : feedback.reports) {
    if (report.has_exchange && report.link == path.id) {
      const TimePoint s{report.s.time_since_epoch()};
      const auto update = clock_.add(now, PeerTime{Duration{feedback.u}}, s, report.h);
      if (update == guard::ClockOffset::Update::kStepped) input.clock_stepped = true;
      if (update != guard::ClockOffset::Update::kRejected) {
        const std::int64_t away =
            wrapping_sub(now.time_since_epoch().count(), s.time_since_epoch().count());
        path.estimator.round_trip(now, Duration{wrapping_sub(away, report.h.count())});
      }
    }
    learn_report(now, report);
  }
  refresh_views(now);
}

void Peer::learn_report(TimePoint now, const wire::LinkReport& report) {
  Path* path = find(report.link);
  if (path == nullptr) return;
  const std::optional<DataRate> paced_at = sender_.pacing_rate(path->id);
  const flow::Sender::Verdicts verdicts = sender_.report(now, report);
  path->estimator.acknowledged(verdicts.acknowledged);
  path->estimator.lost(verdicts.lost);
  path->lost += verdicts.lost;
  path->estimator.train(report.train_start, report.train_packets, report.train_rate, paced_at);
}

void Peer::refresh_views(TimePoint now) {
  for (const Path& path : paths_) {
    sender_.set_path(path.id, {path.estimator.up(now), path.estimator.rate(),
                               path.estimator.one_way(), path.estimator.probe_timeout()});
  }
}

// --- time

Duration Peer::heartbeat_interval(TimePoint now) const {
  return now - active_at_ < kActive ? kHeartbeat : kIdleHeartbeat;
}

std::size_t Peer::handle_timeout(TimePoint now) {
  refresh_views(now);
  for (const auto& [link, lost] : sender_.handle_timeout(now)) {
    if (Path* path = find(link)) path->lost += lost;
  }
  return reassembler_.expire(now);
}

std::optional<TimePoint> Peer::next_timeout() const {
  std::optional<TimePoint> next;
  const auto consider = [&next](std::optional<TimePoint> t) {
    if (t && (!next || *t < *next)) next = t;
  };
  consider(sender_.next_timeout());
  consider(reassembler_.next_timeout());
  consider(feedback_at_);
  for (const Path& path : paths_) {
    consider(path.heartbeat_at);
    if (may_send(path, kMaxDatagramBytes)) consider(sender_.next_send(path.id));
  }
  return next;
}

// --- output

bool Peer::may_send(const Path& path, std::size_t size) const {
  return path.validated || path.bytes_out + size <= kAmplification * path.bytes_in;
}

wire::PacketHeader Peer::header(const Path& path, wire::PacketType type,
                                std::uint64_t number) const {
  return {type, path.id, wire::kClearEpoch, identity_.self, number};
}

Transmit Peer::out(Path& path, std::size_t size) {
  path.bytes_out += size;
  return {path.nic, path.address, size};
}

Peer::Path* Peer::fastest(TimePoint now) {
  Path* best = nullptr;
  for (Path& path : paths_) {
    if (!path.estimator.up(now)) continue;
    // A path whose delay is not known yet is behind those that were measured.
    const auto delay = [](const Path& p) {
      const Duration d = p.estimator.one_way();
      return d > Duration::zero() ? d : Duration::max();
    };
    if (best == nullptr || delay(path) < delay(*best)) best = &path;
  }
  return best;
}

Transmit Peer::send_feedback(TimePoint now, Path& path, std::span<std::byte> buffer) {
  wire::Feedback feedback;
  feedback.u = now.time_since_epoch().count();
  feedback.echo = identity_.session;
  feedback.reports.reserve(paths_.size());
  for (Path& p : paths_) feedback.reports.push_back(p.receiver.report(now));
  const std::uint64_t number = sender_.take_number(now, path.id);
  const std::size_t size =
      wire::write_feedback(buffer, header(path, wire::PacketType::kFeedback, number), feedback);
  return out(path, size);
}

std::optional<Transmit> Peer::poll_feedback(TimePoint now, std::span<std::byte> buffer) {
  if (feedback_at_ && *feedback_at_ <= now) {
    feedback_at_.reset();
    unreported_ = 0;
    feedback_sent_at_ = now;
    for (Path& p : paths_) p.receiver.reported();
    Path* path = fastest(now);
    if (path != nullptr && may_send(*path, wire::feedback_bytes(paths_.size()))) {
      return send_feedback(now, *path, buffer);
    }
  }
  for (Path& path : paths_) {
    if (path.heartbeat_at > now) continue;
    path.heartbeat_at = now + heartbeat_interval(now);
    if (may_send(path, wire::feedback_bytes(paths_.size()))) {
      return send_feedback(now, path, buffer);
    }
  }
  return std::nullopt;
}

std::optional<Transmit> Peer::poll_train(TimePoint now, Path& path, std::span<std::byte> buffer) {
  const bool wanted = ready_ && !path.estimator.rate() && path.estimator.up(now) && path.validated;
  if (path.train_left == 0) {
    if (!wanted || (path.train_at && now - *path.train_at < kStartTrainPause)) return std::nullopt;
    path.train_at = now;
    path.train_left = kStartTrainPackets;
  }
  --path.train_left;
  const std::uint64_t number = sender_.take_number(now, path.id);
  const std::size_t size =
      wire::write_probe(buffer, header(path, wire::PacketType::kProbe, number), path.max_datagram);
  return out(path, size);
}

std::optional<Transmit> Peer::poll(TimePoint now, std::span<std::byte> buffer) {
  if (auto transmit = poll_feedback(now, buffer)) return transmit;
  for (Path& path : paths_) {
    if (auto transmit = poll_train(now, path, buffer)) return transmit;
    if (!may_send(path, kMaxDatagramBytes)) continue;
    const auto piece = sender_.poll(now, path.id);
    if (!piece) continue;
    const std::size_t size =
        wire::write_data(buffer, header(path, wire::PacketType::kData, piece->number),
                         piece->fragment, piece->bytes);
    return out(path, size);
  }
  return std::nullopt;
}

void Peer::send(TimePoint now, TimePoint deadline, Duration lifetime, Bytes message,
                const std::vector<LinkId>& paths) {
  active_at_ = now;
  refresh_views(now);
  sender_.send(now, deadline, lifetime, std::move(message), paths);
}

// --- getters

std::vector<LinkState> Peer::links(TimePoint now) const {
  std::vector<LinkState> out;
  out.reserve(paths_.size());
  for (const Path& path : paths_) {
    LinkState state = path.estimator.state(now);
    state.id = path.id;
    out.push_back(state);
  }
  link::score(out);
  return out;
}

std::pair<std::uint64_t, std::uint64_t> Peer::repairs(LinkId nic) const {
  std::pair<std::uint64_t, std::uint64_t> sum{0, 0};
  for (const Path& path : paths_) {
    if (path.nic != nic) continue;
    sum.first += sender_.resent(path.id);
    sum.second += path.lost;
  }
  return sum;
}

}  // namespace interneuron
