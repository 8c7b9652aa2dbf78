#include "core/flow/sender.h"

#include <algorithm>

#include "core/base/earliest.h"

namespace interneuron::flow {
namespace {

// A path may catch up with this much time at its rate after idling or a late timer: it makes up for
// the timer and fills no queue (docs/constants.md, "Rate of a link").
constexpr Duration kBurst = std::chrono::milliseconds(1);
// Packets leave in batches of this much time at the pace, so that one system call carries several:
// 13 packets at 300 Mbit/s.
constexpr Duration kQuantum = std::chrono::microseconds(500);
// How far apart acknowledgements of a slow link may come: a full packet takes 6 ms at 2 Mbit/s, and
// the receiver delays feedback by up to 5 ms.
constexpr Duration kMinBetween = std::chrono::milliseconds(15);
// The longest time that a packet may occupy the path at the pace, so that a wrong pace of almost
// nothing does not block the path for ever.
constexpr Duration kLongestAir = std::chrono::seconds(1);
// Stands for a time beyond any that is planned with, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);

SentPackets::Silence silence_of(const PathView& view) {
  // An acknowledgement tells of packets sent a round trip ago. The packets sent right after those
  // should be acknowledged within the time that the timeout allows beyond a round trip.
  return {view.probe_timeout, std::max(view.probe_timeout - 2 * view.one_way, kMinBetween)};
}

}  // namespace

void Sender::add_path(LinkId path, std::size_t max_datagram, std::uint64_t first_number) {
  const auto [it, fresh] = paths_.try_emplace(path);
  if (!fresh) return;
  it->second.max_datagram = max_datagram;
  it->second.sent = SentPackets(first_number);
}

void Sender::remove_path(TimePoint now, LinkId path) {
  const auto it = paths_.find(path);
  if (it == paths_.end()) return;
  Path gone = std::move(it->second);
  paths_.erase(it);
  settle(now, gone.sent.in_flight());
  for (const Job& job : gone.jobs) hand_on(now, job);
}

void Sender::pull(TimePoint now, LinkId link) {
  const auto it = paths_.find(link);
  if (it == paths_.end()) return;
  Path& path = it->second;
  path.view.up = false;
  // What is in flight is queued again but not settled as lost: it may have arrived, and then its
  // acknowledgement saves the second copy.
  for (const auto& [piece, arrived, was_open] : path.sent.in_flight()) {
    const auto message = messages_.find(piece.message);
    if (message == messages_.end()) continue;
    if (!message->second.pieces[piece.index].acknowledged) repair(now, piece.message, piece.index);
  }
  for (Job& job : path.jobs) {
    const auto message = messages_.find(job.message);
    if (message == messages_.end()) continue;
    const std::vector<std::uint16_t> indices = job.owed();
    job.again.clear();
    job.next = job.count;
    for (const std::uint16_t index : indices) {
      Message::PieceState& piece = message->second.pieces[index];
      if (piece.under_way > 0) --piece.under_way;
      if (piece.acknowledged || repair(now, job.message, index)) continue;
      // No other path brings it in time: it waits here for this path to come back.
      ++piece.under_way;
      job.again.push_back(index);
    }
  }
}

void Sender::set_path(LinkId path, const PathView& view) {
  const auto it = paths_.find(path);
  if (it != paths_.end()) it->second.view = view;
}

MessageId Sender::send(TimePoint now, const Times& times, Bytes bytes,
                       const std::vector<LinkId>& paths, const PathSet& repairs,
                       wire::MessageKind kind) {
  const MessageId id{next_message_++};
  if (paths.empty() || bytes.empty() || times.deadline <= now) return id;

  Message m;
  const std::size_t chunk = piece_bytes(paths, repairs);
  const std::size_t count = (bytes.size() + chunk - 1) / chunk;
  if (count > UINT16_MAX) return id;
  m.chunk = static_cast<std::uint16_t>(chunk);
  m.count = static_cast<std::uint16_t>(count);
  m.unacknowledged = m.count;
  m.deadline = times.deadline;
  m.doubt = times.doubt;
  m.lifetime_us = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(times.lifetime).count(), 1,
      UINT32_MAX));
  m.bytes = std::move(bytes);
  m.repairs = repairs;
  m.kind = kind;
  m.paths = static_cast<std::uint8_t>(paths.size());
  m.pieces.resize(count, {false, static_cast<std::uint8_t>(paths.size())});
  for (const LinkId path : paths) {
    Path& p = paths_.at(path);
    p.use.message(now, m.bytes.size(), m.deadline - now);
    p.add(m, id, 0);
    m.repairs.add(path);
  }
  messages_.emplace(id, std::move(m));
  return id;
}

std::uint64_t Sender::take_number(TimePoint now, LinkId link, std::size_t train_bytes) {
  SentPackets& sent = paths_.at(link).sent;
  return train_bytes > 0 ? sent.add(now, train_bytes, false, std::nullopt) : sent.add_small(now);
}

std::size_t Sender::queued_bytes(const Path& path, TimePoint deadline) const {
  std::size_t bytes = 0;
  for (const Job& job : path.jobs) {
    if (job.deadline <= deadline && messages_.contains(job.message)) bytes += job.bytes();
  }
  return bytes;
}

Job* Sender::next_job(Path& path, TimePoint now) {
  while (!path.jobs.empty()) {
    Job& job = *std::ranges::min_element(path.jobs, {}, &Job::deadline);
    const auto it = messages_.find(job.message);
    const bool done = it == messages_.end() || (job.again.empty() && job.next >= it->second.count);
    if (!done && now < job.deadline) {
      if (can_arrive(now, path, job, it->second)) return &job;
      give_up(job, it->second);
      // Nobody else completes it, so nothing of it is sent again.
      if (it->second.paths == 1) {
        if (it->second.kind == wire::MessageKind::kPlain) given_up_.push_back(it->first);
        messages_.erase(it);
      }
    }
    path.remove(job);
  }
  return nullptr;
}

bool Sender::can_arrive(TimePoint now, const Path& path, const Job& job, const Message& message) {
  const Duration least =
      least_time(path.view, job.ip_bytes(), path.sent.bytes_in_flight(), job.next > 0);
  return now + least <= message.deadline + message.doubt;
}

void Sender::give_up(const Job& job, Message& message) {
  job.for_each([this, &message](std::uint16_t index) {
    Message::PieceState& piece = message.pieces[index];
    if (piece.under_way > 0) --piece.under_way;
    if (!piece.acknowledged) ++cancelled_;
  });
}

// The next fragment of a job that is not acknowledged yet.
std::optional<std::uint16_t> Sender::take_index(Job& job, bool& is_repair) {
  Message& m = messages_.at(job.message);
  for (;;) {
    std::uint16_t index = 0;
    is_repair = !job.again.empty();
    if (is_repair) {
      index = job.again.front();
      job.again.pop_front();
    } else if (job.next < m.count) {
      index = static_cast<std::uint16_t>(job.next++);
    } else {
      return std::nullopt;
    }
    if (!m.pieces[index].acknowledged) return index;
    if (m.pieces[index].under_way > 0) --m.pieces[index].under_way;
  }
}

std::optional<Sender::Piece> Sender::poll(TimePoint now, LinkId path_id) {
  Path& path = paths_.at(path_id);
  if (!path.view.up) return std::nullopt;
  if (now < path.free_at || is_full(path)) {
    if (!path.jobs.empty()) path.use.held_back();
    return std::nullopt;
  }
  for (;;) {
    Job* job = next_job(path, now);
    if (job == nullptr) {
      path.use.emptied(now);
      return std::nullopt;
    }
    bool is_repair = false;
    const auto index = take_index(*job, is_repair);
    if (!index) continue;

    Message& m = messages_.at(job->message);
    const std::size_t offset = std::size_t{*index} * m.chunk;
    const std::size_t size = std::min<std::size_t>(m.chunk, m.bytes.size() - offset);
    const std::size_t ip_bytes = size + kPieceOverheadBytes + kIpUdpBytes;
    const bool more_waits = job->next < m.count || !job->again.empty() || path.jobs.size() > 1;
    const std::uint64_t number =
        path.sent.add(now, ip_bytes, more_waits, SentPackets::Piece{job->message, *index});
    if (is_repair) ++path.resent;

    const Duration air = path.view.pace.value_or(kBlindPace).transmit_time(ip_bytes);
    path.free_at = std::max(path.free_at, now - kBurst) + std::min<Duration>(air, kLongestAir);
    const Piece piece{number,
                      {job->message, *index, m.chunk, static_cast<std::uint32_t>(m.bytes.size()),
                       m.lifetime_us, m.kind},
                      ByteView(m.bytes).subspan(offset, size)};
    if (job->pieces() == 0) path.remove(*job);
    if (path.jobs.empty()) path.use.emptied(now);
    return piece;
  }
}

// Takes in what became of fragments: they are acknowledged, or lost and sent again.
void Sender::settle(TimePoint now, std::span<const SentPackets::Settled> pieces) {
  for (const auto& [what, arrived, was_open] : pieces) {
    const auto it = messages_.find(what.message);
    if (it == messages_.end()) continue;
    Message::PieceState& piece = it->second.pieces[what.index];
    if (was_open && piece.under_way > 0) --piece.under_way;
    if (piece.acknowledged) continue;
    if (!arrived) {
      repair(now, what.message, what.index);
      continue;
    }
    piece.acknowledged = true;
    if (--it->second.unacknowledged > 0) continue;
    if (it->second.kind == wire::MessageKind::kPlain) acknowledged_.push_back(it->first);
    messages_.erase(it);
  }
}

SentPackets::Verdicts Sender::report(TimePoint now, const wire::LinkReport& report,
                                     Duration min_rtt) {
  const auto it = paths_.find(report.link);
  if (it == paths_.end()) return {};
  Path& path = it->second;
  const auto verdicts = path.sent.report(now, report, min_rtt, silence_of(path.view));
  settle(now, verdicts.pieces);
  return verdicts;
}

PathUse::Told Sender::take_use(TimePoint now, LinkId link) {
  const auto it = paths_.find(link);
  return it == paths_.end() ? PathUse::Told{} : it->second.use.take(now);
}

// When the soonest copy of a fragment that is queued or in flight should arrive; nothing when there
// is no such copy.
std::optional<TimePoint> Sender::expected_arrival(TimePoint now, MessageId id,
                                                  std::uint16_t index) const {
  const Message& m = messages_.at(id);
  if (m.pieces[index].under_way == 0) return std::nullopt;
  std::optional<TimePoint> best;
  for (const auto& [link, path] : paths_) {
    if (!path.view.up) continue;
    const auto job = std::ranges::find(path.jobs, id, &Job::message);
    if (job != path.jobs.end() && (index >= job->next || job->is_again(index))) {
      const std::size_t ahead = index >= job->next ? index - job->next + 1U : job->again.size();
      const DataRate rate = path.view.rate.value_or(kBlindRate);
      const Duration air = std::min<Duration>(rate.transmit_time(ahead * m.chunk), kNever);
      best = earliest(best, now + air + path.view.one_way);
    }
    const auto sent_at = path.sent.sent_at({id, index});
    if (sent_at) best = earliest(best, *sent_at + path.view.one_way);
  }
  return best;
}

// Queues a fragment again on the path that brings it soonest, unless that is too late or another
// copy is sooner still.
bool Sender::repair(TimePoint now, MessageId id, std::uint16_t index) {
  if (!options_.repair) return false;
  Message& m = messages_.at(id);
  Path* best = nullptr;
  TimePoint best_arrival = TimePoint::max();
  for (auto& [link, path] : paths_) {
    const bool may_carry =
        m.repairs.contains(link) && path.max_datagram >= m.chunk + kPieceOverheadBytes;
    if (!path.view.up || !may_carry) continue;
    const DataRate rate = path.view.rate.value_or(kBlindRate);
    const Duration queue =
        std::min<Duration>(rate.transmit_time(queued_bytes(path) + m.chunk), kNever);
    const TimePoint arrival = now + queue + path.view.one_way;
    const bool in_time = arrival <= m.deadline;
    // A backup only where no other path is in time.
    const bool better =
        best == nullptr || (path.view.backup == best->view.backup ? arrival < best_arrival
                            : path.view.backup ? in_time && best_arrival > m.deadline
                                               : in_time || best_arrival > m.deadline);
    if (better) {
      best = &path;
      best_arrival = arrival;
    }
  }
  const std::optional<TimePoint> other = expected_arrival(now, id, index);
  if (other && *other <= best_arrival) return false;
  if (best == nullptr || best_arrival > m.deadline) {
    ++cancelled_;
    return false;
  }
  ++m.pieces[index].under_way;
  best->use.queued(now);
  const auto job = std::ranges::find(best->jobs, id, &Job::message);
  if (job != best->jobs.end()) {
    job->again.push_back(index);
  } else {
    best->add(m, id, m.count).again.push_back(index);
  }
  return true;
}

void Sender::handle_timeout(TimePoint now) {
  for (auto& [link, path] : paths_) {
    const auto silent = path.sent.settle_silent(now, silence_of(path.view));
    path.use.lost(static_cast<std::uint32_t>(silent.size()));
    settle(now, silent);
  }
  std::erase_if(messages_, [now](const auto& entry) { return entry.second.deadline <= now; });
  // Jobs end in poll(), but a path that may not send is never polled: jobs of messages that nobody
  // waits for must not pile up on it.
  for (auto& [link, path] : paths_) {
    std::erase_if(path.jobs, [this](const Job& job) { return !messages_.contains(job.message); });
  }
}

std::optional<TimePoint> Sender::next_timeout() const {
  std::optional<TimePoint> next;
  for (const auto& [link, path] : paths_) {
    next = earliest(next, path.sent.silent_at(silence_of(path.view)));
  }
  for (const auto& [id, message] : messages_) next = earliest(next, message.deadline);
  return next;
}

std::optional<TimePoint> Sender::next_send(LinkId path) const {
  const auto it = paths_.find(path);
  if (it == paths_.end() || it->second.jobs.empty() || !it->second.view.up) return std::nullopt;
  // A report or a timeout makes room.
  if (is_full(it->second)) return std::nullopt;
  return saturating_add(it->second.free_at, kQuantum);
}

bool Sender::is_queued(MessageId message) const {
  if (!messages_.contains(message)) return false;
  return std::ranges::any_of(paths_, [message](const auto& entry) {
    return std::ranges::any_of(entry.second.jobs, [message](const Job& job) {
      return job.message == message && job.next < job.count;
    });
  });
}

std::size_t Sender::queued_before(LinkId link, TimePoint deadline) const {
  const auto it = paths_.find(link);
  return it == paths_.end() ? 0 : queued_bytes(it->second, deadline);
}

std::uint64_t Sender::resent(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.resent;
}

std::uint64_t Sender::lost(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.sent.lost();
}

void Sender::reset(TimePoint now) {
  messages_.clear();
  acknowledged_.clear();
  given_up_.clear();
  for (auto& [link, path] : paths_) {
    path.jobs.clear();
    path.sent.reset();
    path.free_at = now;
  }
}

}  // namespace interneuron::flow
