#include "core/peers/peer.h"

#include <algorithm>

#include "core/base/earliest.h"
#include "core/base/split_mix.h"

namespace interneuron::peers {
namespace {

// What only time changes is looked at again after this long and not for every packet, because it
// means to look at every path.
constexpr Duration kRefresh = std::chrono::milliseconds(1);
// Feedback that left so long ago tells nothing of when it did: the longest round trip that is
// believed (src/core/guard/clock_offset.cc).
constexpr Duration kStale = std::chrono::seconds(60);
// After so long both sides have seen a round trip that is about the smallest one; until then either
// may judge by one that is far longer. No measurement behind this value: it only has to be several
// heartbeats.
constexpr Duration kClockSettles = std::chrono::seconds(1);
// So much shorter than any before a round trip may be by itself; one that is shorter still may have
// become so by a step of the peer's clock. No measurement behind this value: it only has to be what
// event loops add by chance.
constexpr Duration kRoundTripError = std::chrono::microseconds(500);

// What this path does at a time of its own choice, others shall not do at the same time.
std::uint64_t seed_of(const Peer::Identity& identity, LinkId path) {
  const std::uint64_t state = split_mix(identity.self.value) + identity.id.value;
  return split_mix(state) + path.value;
}

}  // namespace

Peer::Peer(const Identity& identity, TimePoint now)
    : identity_(identity),
      paths_(identity.id),
      sender_(
          {.repair = identity.repair,
           .first_message = MessageId{static_cast<std::uint32_t>(
               std::chrono::floor<std::chrono::milliseconds>(now - identity.started).count())}}),
      intake_(identity.limits, now),
      heard_at_(now),
      refreshed_at_(now) {}

void Peer::add_path(TimePoint now, LinkId id, const Path::Nic& nic, const Address& address) {
  if (Path* known = paths_.find(id)) {
    if (known->address() == address && known->nic().link == nic.link) return;
    known->move_to(now, nic, address);
  } else {
    if (paths_.size() >= wire::kMaxReports) return;
    const Path& added = paths_.add(now, id, nic, address,
                                   Path::Origin{identity_.connected, seed_of(identity_, id)});
    // Within one session packet numbers only grow, also when a peer or a path was forgotten and
    // comes back: the other side may remember it and would drop smaller ones as duplicates. So
    // numbers begin at the microseconds of our life so far, and the numbers of messages at the
    // milliseconds; more than that are not sent on average.
    const auto life = std::chrono::floor<std::chrono::microseconds>(now - identity_.started);
    sender_.add_path(id, added.datagram(), 1 + static_cast<std::uint64_t>(life.count()));
  }
  refresh(now);
}

void Peer::follow(TimePoint now, const wire::PacketHeader& header, const Path::Nic& nic,
                  const Address& address) {
  const Path* known = paths_.find(header.link);
  if (known != nullptr && header.number <= known->receiver.largest()) return;
  if (known == nullptr && paths_.size() >= wire::kMaxReports) drop_dead_path(now);
  add_path(now, header.link, nic, address);
}

// A peer that takes away a NIC does not say so. Where it brings another one, a path that is dead
// makes room.
void Peer::drop_dead_path(TimePoint now) {
  const auto dead = std::ranges::find_if(
      paths_, [](const Path& path) { return path.estimator.path() == PathState::kDead; });
  if (dead == paths_.end()) return;
  const LinkId id = dead->id();
  sender_.remove_path(now, id);
  paths_.remove(id);
}

void Peer::remove_nic(TimePoint now, LinkId nic) {
  for (Path& path : paths_) {
    if (path.nic().link != nic) continue;
    path.estimator.removed(now);
    collect_changes(now, path);
    sender_.remove_path(now, path.id());
  }
  paths_.remove_nic(nic);
  refresh(now);
}

void Peer::restart(TimePoint now, SessionId session) {
  identity_.session = session;
  session_ = {};
  sender_.reset(now);
  intake_.reset();
  settlements_.reset();
  for (Path& path : paths_) path.reset(now);
  refresh(now);
}

// --- input

Peer::Outcome Peer::handle(TimePoint now, const wire::Packet& packet, const Datagram& datagram,
                           std::size_t room) {
  Outcome outcome;
  if (!intake_.may_come(now)) {
    outcome.limited = true;
    return outcome;
  }
  Path& path = *paths_.find(packet.header.link);
  const bool is_feedback = packet.header.type == wire::PacketType::kFeedback;
  using Role = flow::PathReceiver::Role;
  const Role role = is_feedback                                      ? Role::kNone
                    : packet.header.type == wire::PacketType::kProbe ? Role::kProbe
                                                                     : Role::kData;
  // What was sealed was opened once, whatever its number is.
  const bool is_new = packet.header.epoch != wire::kClearEpoch;
  if (!path.receiver.accept(now, packet.header.number, role, datagram.bytes.size() + kIpUdpBytes,
                            datagram.ecn, is_new, packet.header.stamp_us)) {
    outcome.duplicate = true;
    return outcome;
  }
  heard_at_ = now;
  path.estimator.heard(now);
  collect_changes(now, path);
  if (is_feedback) {
    handle_feedback(now, path, packet.feedback, outcome);
    return outcome;
  }
  intake_.feedback.arrived(now, path.receiver.gap());
  if (!wire::is_used(packet.header.type)) return outcome;
  path.receiver.note_delay(session_time(now), packet.header.stamp_us);
  const bool is_window = packet.header.type == wire::PacketType::kWindow;
  if (is_window || packet.header.type == wire::PacketType::kData) {
    path.received_message(now, datagram.bytes.size() + kIpUdpBytes);
  }
  if (is_window) intake_.remember(now, packet.window, room);
  if (packet.header.type != wire::PacketType::kData) return outcome;
  if (take_piece(now, packet.data, room, outcome)) intake_.remember(packet.data);
  if (outcome.message) path.receiver.message_ends();
  return outcome;
}

std::optional<Peer::Outcome> Peer::handle_computed(TimePoint now, std::size_t room) {
  const auto data = intake_.poll_computed();
  if (!data) return std::nullopt;
  Outcome outcome;
  take_piece(now, *data, room, outcome);
  return outcome;
}

bool Peer::take_piece(TimePoint now, const wire::Data& data, std::size_t room, Outcome& outcome) {
  flow::ClockBounds clocks{identity_.self, identity_.session, std::nullopt};
  if (data.fragment.index == 0) clocks.peer_hi_min = session_.clock.hi_min(now);
  const bool is_wanted = intake_.take_piece(now, data, clocks, room, outcome);
  if (outcome.message) paths_.note_activity(now);
  return is_wanted;
}

void Peer::handle_feedback(TimePoint now, Path& path, const wire::Feedback& feedback,
                           Outcome& outcome) {
  path.receiver.exchange(now, PeerTime{Duration{feedback.u}});
  // Else it is meant for an earlier session of ours, or the peer has not heard us.
  if (feedback.echo != identity_.self) return;
  if (!session_.ready) outcome.became_ready = session_.ready = was_ready_ = true;
  settlements_.learn(feedback);
  sender_.set_windows((feedback.features & wire::kDecodesWindows) != 0);
  const auto clock = session_.clock.view(now);
  if (!clock) session_.clock_since = now;
  std::optional<TimePoint> left;
  for (const wire::CompleteMessage& complete : feedback.complete) {
    sender_.complete(now, complete.message);
  }
  for (const wire::LinkReport& report : feedback.reports) {
    if (report.has_exchange && report.link == path.id()) {
      const PeerTime u{Duration{feedback.u}};
      const auto update =
          session_.clock.add(now, u, TimePoint{report.s.time_since_epoch()}, report.h);
      if (update == guard::ClockOffset::Update::kStepped) {
        outcome.clock_stepped = true;
        session_.clock_since = now;
        for (Path& p : paths_) p.clock_stepped();
      }
      if (update != guard::ClockOffset::Update::kRejected) path.learn_exchange(now, u, report);
      if (clock) left = left_at(now, report, clock->rtt_min);
    }
    learn_report(now, report);
  }
  sender_.settle_overdue(feedback.reports, left);
  refresh(now);
}

// What we had sent at `s` was there before the feedback left, and the peer had held it for `h`: no
// offset of clocks is needed for that, so that none from before a step can be wrong. Where the
// peer's clock goes forward while it holds it, the round trip seems too short. The peer judges by
// its own estimate whether a message is in time, which may be half a round trip wrong.
std::optional<TimePoint> Peer::left_at(TimePoint now, const wire::LinkReport& report,
                                       Duration rtt_min) {
  const std::int64_t left = wrapping_add(report.s.time_since_epoch().count(), report.h.count());
  const Duration round_trip{wrapping_sub(now.time_since_epoch().count(), left)};
  if (round_trip > kStale || round_trip < rtt_min - kRoundTripError) return std::nullopt;
  if (now < session_.clock_since + kClockSettles) return std::nullopt;
  return now - round_trip - rtt_min / 2;
}

void Peer::learn_report(TimePoint now, const wire::LinkReport& report) {
  Path* path = paths_.find(report.link);
  if (path == nullptr) return;
  const auto verdicts = sender_.report(now, report, path->estimator.rtt_min(now));
  path->learn(now, report, verdicts, sender_.take_use(now, path->id()));
  collect_changes(now, *path);
}

// Collects what the traffic of a path says of it.
void Peer::collect_changes(TimePoint now, Path& path) {
  if (!paths_.note_changes(path)) return;
  refresh(now);
  relieve(now, path);
}

// What is under way on a path that fell goes over the others.
void Peer::relieve(TimePoint now, const Path& path) {
  if (!path.usable()) {
    sender_.pull(now, path.id());
  } else if (path.estimator.path() == PathState::kSuspect) {
    sender_.doubt(now, path.id());
  }
}

void Peer::look(TimePoint now) {
  if (now - refreshed_at_ >= kRefresh) refresh(now);
}

// Looks at the paths until nothing changes: the state of a path may change by being looked at, and
// with that another one may become the last usable one.
void Peer::refresh(TimePoint now) {
  refreshed_at_ = now;
  std::vector<LinkId> changed;
  while (look_again(now, changed)) {
  }
  for (const LinkId id : changed) relieve(now, *paths_.find(id));
}

// Returns whether the state of a path has changed, and adds those paths.
bool Peer::look_again(TimePoint now, std::vector<LinkId>& changed) {
  const DataRate needed = sender_.needed();
  const Duration peer_spacing = paths_.peer_feedback_spacing();
  intake_.feedback.keep_apart(paths_.feedback_spacing());
  for (Path& path : paths_) {
    path.estimator.set_last_usable(std::ranges::none_of(
        paths_, [&path](const Path& p) { return p.id() != path.id() && p.estimator.up(); }));
    path.refresh(now, session_.ready, needed, peer_spacing);
    sender_.set_path(path.id(), path.view(now));
    sender_.resize(now, path.id(), path.datagram());
  }
  const std::size_t before = changed.size();
  for (Path& path : paths_) {
    if (paths_.note_changes(path)) changed.push_back(path.id());
  }
  return changed.size() > before;
}

// --- time

std::size_t Peer::handle_timeout(TimePoint now) {
  for (Path& path : paths_) {
    path.handle_timeout(now);
    const auto due = path.estimator.next_timeout();
    if (!due || *due > now) continue;
    path.estimator.handle_timeout(now);
    collect_changes(now, path);
  }
  look(now);
  sender_.handle_timeout(now);
  return intake_.handle_timeout(now);
}

std::optional<TimePoint> Peer::next_timeout(TimePoint now) const {
  if (sender_.has_failed()) return now;
  auto next = earliest(sender_.next_timeout(), intake_.next_timeout());
  // Where it may not leave, only a path that comes back changes that.
  const auto feedback_at = intake_.feedback.at();
  if (feedback_at && paths_.reporter()) next = earliest(next, feedback_at);
  for (const Path& path : paths_) {
    next = earliest(next, path.next_timeout(now));
    next = earliest(next, sender_.next_send(path.id()));
  }
  return next;
}

// --- getters

Peer::Repairs Peer::repairs(LinkId nic) const {
  Repairs sum;
  for (const Path& path : paths_) {
    if (path.nic().link != nic) continue;
    sum.resent += sender_.resent(path.id());
    sum.symbols += sender_.symbols(path.id());
    sum.lost += sender_.lost(path.id());
  }
  return sum;
}

}  // namespace interneuron::peers
