#include "flow/sender.h"

#include <algorithm>

namespace interneuron::flow {
namespace {

// Pace a little above the estimate, so that it can grow and the bottleneck never idles
// (transport.md §4.2).
constexpr double kPacingHeadroom = 1.25;
// A path may catch up this much after idling or a late timer (transport.md §4.2: burst <= C * 1
// ms).
constexpr Duration kBurst = std::chrono::milliseconds(1);
// Pieces leave in batches of this much time, so that one system call carries several; chosen.
constexpr Duration kQuantum = std::chrono::microseconds(500);
// A packet is lost when one sent this many later has arrived (RFC 9002 §6.1.1).
constexpr std::uint64_t kReorderPackets = 3;
// Records of packets are kept this long for late acknowledgements; chosen.
constexpr Duration kKeepSent = std::chrono::seconds(3);
constexpr std::size_t kMaxSent = 20'000;  // per path: 3 s at 75 Mbit/s; chosen
constexpr std::size_t kIpUdpOverhead = 28;
// The longest deadline there is; keeps sums of times in range.
constexpr Duration kNever = std::chrono::hours(1);

}  // namespace

void Sender::add_path(LinkId path, std::size_t max_datagram, std::uint64_t first_number) {
  const auto [it, fresh] = paths_.try_emplace(path);
  it->second.max_datagram = max_datagram;
  if (fresh) it->second.next_number = first_number;
}

void Sender::remove_path(TimePoint now, LinkId path) {
  const auto it = paths_.find(path);
  if (it == paths_.end()) return;
  Path gone = std::move(it->second);
  paths_.erase(it);
  for (Sent& sent : gone.sent) {
    if (!sent.settled) lose(now, sent);
  }
  for (Job& job : gone.jobs) {
    const auto message = messages_.find(job.message);
    if (message == messages_.end()) continue;
    std::vector<std::uint16_t> owed(job.again.begin(), job.again.end());
    for (std::uint32_t i = job.next; i < message->second.count; ++i) {
      owed.push_back(static_cast<std::uint16_t>(i));
    }
    for (const std::uint16_t index : owed) {
      Message::PieceState& piece = message->second.pieces[index];
      if (piece.under_way > 0) --piece.under_way;
      if (!piece.acknowledged && piece.under_way == 0) repair(now, job.message, index);
    }
  }
}

void Sender::set_path(LinkId path, const PathView& view) {
  const auto it = paths_.find(path);
  if (it != paths_.end()) it->second.view = view;
}

MessageId Sender::send(TimePoint now, TimePoint deadline, Duration lifetime, Bytes bytes,
                       const std::vector<LinkId>& paths) {
  const MessageId id{next_message_++};
  std::size_t max_datagram = SIZE_MAX;
  for (const LinkId path : paths)
    max_datagram = std::min(max_datagram, paths_.at(path).max_datagram);
  if (paths.empty() || bytes.empty() || deadline <= now) return id;

  Message m;
  const std::size_t chunk = max_datagram - wire::kFragmentOverhead;
  const std::size_t count = (bytes.size() + chunk - 1) / chunk;
  if (count > UINT16_MAX) return id;
  m.chunk = static_cast<std::uint16_t>(chunk);
  m.count = static_cast<std::uint16_t>(count);
  m.unacknowledged = m.count;
  m.deadline = deadline;
  m.lifetime_us = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(lifetime).count(), 1, UINT32_MAX));
  m.bytes = std::move(bytes);
  m.pieces.resize(count, {false, static_cast<std::uint8_t>(paths.size())});
  for (const LinkId path : paths) {
    Path& p = paths_.at(path);
    p.jobs.push_back({id, deadline, 0, m.count, m.chunk, {}});
  }
  messages_.emplace(id, std::move(m));
  return id;
}

std::uint64_t Sender::take_number(TimePoint now, LinkId path) {
  Path& p = paths_.at(path);
  const std::uint64_t number = p.next_number++;
  trim(p, now);
  p.sent.push_back({number, now, false, false, {}, 0});
  return number;
}

void Sender::trim(Path& path, TimePoint now) {
  while (!path.sent.empty() && path.sent.front().settled) path.sent.pop_front();
  while (!path.sent.empty() &&
         (path.sent.size() >= kMaxSent || path.sent.front().at < now - kKeepSent)) {
    path.sent.pop_front();
  }
}

std::size_t Sender::queued_bytes(const Path& path) const {
  std::size_t bytes = 0;
  for (const Job& job : path.jobs) {
    if (!messages_.contains(job.message)) continue;
    bytes +=
        (job.count - std::min<std::size_t>(job.next, job.count) + job.again.size()) * job.chunk;
  }
  return bytes;
}

Sender::Job* Sender::next_job(Path& path, TimePoint now) {
  while (!path.jobs.empty()) {
    Job& job = *std::ranges::min_element(path.jobs, {}, &Job::deadline);
    const auto it = messages_.find(job.message);
    const bool done = it == messages_.end() || (job.again.empty() && job.next >= it->second.count);
    if (!done && now < job.deadline) return &job;
    path.jobs.erase(path.jobs.begin() + (&job - path.jobs.data()));
  }
  return nullptr;
}

// The next piece of a job that nobody has acknowledged yet.
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
  if (now < path.free_at) return std::nullopt;
  for (;;) {
    Job* job = next_job(path, now);
    if (job == nullptr) return std::nullopt;
    bool is_repair = false;
    const auto index = take_index(*job, is_repair);
    if (!index) continue;

    Message& m = messages_.at(job->message);
    const std::size_t offset = std::size_t{*index} * m.chunk;
    const std::size_t size = std::min<std::size_t>(m.chunk, m.bytes.size() - offset);
    trim(path, now);
    const std::uint64_t number = path.next_number++;
    path.sent.push_back({number, now, true, false, job->message, *index});
    if (is_repair) ++path.resent;

    const DataRate pace = path.view.rate.value_or(kBlindRate).scaled(kPacingHeadroom);
    const Duration air = pace.transmit_time(size + wire::kFragmentOverhead + kIpUdpOverhead);
    path.free_at =
        std::max(path.free_at, now - kBurst) + std::min<Duration>(air, std::chrono::seconds(1));
    return Piece{number,
                 {job->message, *index, m.count, m.chunk, m.lifetime_us},
                 ByteView(m.bytes).subspan(offset, size)};
  }
}

void Sender::acknowledge(const Sent& sent) {
  const auto it = messages_.find(sent.message);
  if (it == messages_.end()) return;
  Message::PieceState& piece = it->second.pieces[sent.index];
  if (piece.under_way > 0) --piece.under_way;
  if (piece.acknowledged) return;
  piece.acknowledged = true;
  if (--it->second.unacknowledged == 0) forget(sent.message);
}

void Sender::forget(MessageId id) { messages_.erase(id); }

Sender::Verdicts Sender::report(TimePoint now, const wire::LinkReport& report) {
  Verdicts verdicts;
  const auto it = paths_.find(report.link);
  if (it == paths_.end() || report.largest == 0 || report.largest >= it->second.next_number) {
    return verdicts;
  }
  Path& path = it->second;
  const std::uint64_t window_start =
      report.largest > wire::kAckWindow ? report.largest - wire::kAckWindow : 0;
  // Losing a piece may queue repairs but never touches `sent`.
  for (Sent& sent : path.sent) {
    if (sent.number > report.largest) break;
    if (sent.settled) continue;
    const std::uint64_t back = report.largest - sent.number;
    const bool arrived =
        back == 0 || (sent.number >= window_start &&
                      (report.bitmap[(back - 1) / 64] >> ((back - 1) % 64) & 1U) != 0);
    if (arrived) {
      sent.settled = true;
      ++verdicts.acknowledged;
      if (sent.has_piece) {
        path.progress_at = now;
        acknowledge(sent);
      }
    } else if (back >= kReorderPackets) {
      ++verdicts.lost;
      lose(now, sent);
    }
  }
  verdicts.used_path = verdicts.acknowledged + verdicts.lost > 0;
  trim(path, now);
  return verdicts;
}

void Sender::lose(TimePoint now, Sent& sent) {
  sent.settled = true;
  if (!sent.has_piece) return;
  const auto it = messages_.find(sent.message);
  if (it == messages_.end()) return;
  Message::PieceState& piece = it->second.pieces[sent.index];
  if (piece.under_way > 0) --piece.under_way;
  if (!piece.acknowledged) repair(now, sent.message, sent.index);
}

// When the best copy of a piece that is still queued or in flight should arrive; nothing if there
// is none.
std::optional<TimePoint> Sender::expected_arrival(TimePoint now, MessageId id,
                                                  std::uint16_t index) const {
  const Message& m = messages_.at(id);
  if (m.pieces[index].under_way == 0) return std::nullopt;
  std::optional<TimePoint> best;
  const auto consider = [&best](TimePoint t) {
    if (!best || t < *best) best = t;
  };
  for (const auto& [link, path] : paths_) {
    const auto job = std::ranges::find(path.jobs, id, &Job::message);
    if (job != path.jobs.end() &&
        (index >= job->next || std::ranges::count(job->again, index) > 0)) {
      const std::size_t ahead = index >= job->next ? index - job->next + 1U : job->again.size();
      const DataRate rate = path.view.rate.value_or(kBlindRate);
      consider(now + std::min<Duration>(rate.transmit_time(ahead * m.chunk), kNever) +
               path.view.one_way);
    }
    for (auto sent = path.sent.rbegin(); sent != path.sent.rend(); ++sent) {
      if (sent->settled || !sent->has_piece || sent->message != id || sent->index != index)
        continue;
      consider(sent->at + path.view.one_way);
      break;
    }
  }
  return best;
}

// Sends a piece again over the path that brings it soonest, unless that is too late or another copy
// is sooner still.
void Sender::repair(TimePoint now, MessageId id, std::uint16_t index) {
  if (!options_.repair) return;
  Message& m = messages_.at(id);
  Path* best = nullptr;
  TimePoint best_arrival = TimePoint::max();
  for (auto& [link, path] : paths_) {
    if (!path.view.up) continue;
    const DataRate rate = path.view.rate.value_or(kBlindRate);
    const Duration queue =
        std::min<Duration>(rate.transmit_time(queued_bytes(path) + m.chunk), kNever);
    const TimePoint arrival = now + queue + path.view.one_way;
    if (arrival < best_arrival && path.max_datagram >= m.chunk + wire::kFragmentOverhead) {
      best = &path;
      best_arrival = arrival;
    }
  }
  const std::optional<TimePoint> other = expected_arrival(now, id, index);
  if (other && *other <= best_arrival) return;
  if (best == nullptr || best_arrival > m.deadline) {
    ++cancelled_;
    return;
  }
  ++m.pieces[index].under_way;
  const auto job = std::ranges::find(best->jobs, id, &Job::message);
  if (job != best->jobs.end()) {
    job->again.push_back(index);
  } else {
    best->jobs.push_back({id, m.deadline, m.count, m.count, m.chunk, {index}});
  }
}

std::vector<std::pair<LinkId, std::uint64_t>> Sender::handle_timeout(TimePoint now) {
  std::vector<std::pair<LinkId, std::uint64_t>> out;
  for (auto& [link, path] : paths_) {
    std::uint64_t lost = 0;
    for (Sent& sent : path.sent) {
      if (path.silent_at(sent) > now) break;
      if (sent.settled || !sent.has_piece) continue;
      ++lost;
      lose(now, sent);
    }
    if (lost > 0) out.emplace_back(link, lost);
  }
  std::erase_if(messages_, [now](const auto& entry) { return entry.second.deadline <= now; });
  // A path that may not send is never polled: what nobody waits for must not pile up on it.
  for (auto& [link, path] : paths_) {
    std::erase_if(path.jobs, [this](const Job& job) { return !messages_.contains(job.message); });
  }
  return out;
}

std::optional<TimePoint> Sender::next_timeout() const {
  std::optional<TimePoint> next;
  const auto consider = [&next](TimePoint t) {
    if (!next || t < *next) next = t;
  };
  for (const auto& [link, path] : paths_) {
    const auto oldest =
        std::ranges::find_if(path.sent, [](const Sent& s) { return !s.settled && s.has_piece; });
    if (oldest != path.sent.end()) consider(path.silent_at(*oldest));
  }
  for (const auto& [id, message] : messages_) consider(message.deadline);
  return next;
}

std::optional<TimePoint> Sender::next_send(LinkId path) const {
  const auto it = paths_.find(path);
  if (it == paths_.end() || it->second.jobs.empty()) return std::nullopt;
  return saturating_add(it->second.free_at, kQuantum);
}

std::optional<DataRate> Sender::pacing_rate(LinkId path) const {
  const auto it = paths_.find(path);
  if (it == paths_.end() || !it->second.view.rate) return std::nullopt;
  return it->second.view.rate->scaled(kPacingHeadroom);
}

std::uint64_t Sender::resent(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.resent;
}

void Sender::reset(TimePoint now) {
  messages_.clear();
  for (auto& [link, path] : paths_) {
    path.jobs.clear();
    path.sent.clear();
    path.free_at = now;
  }
}

}  // namespace interneuron::flow
