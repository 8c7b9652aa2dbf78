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
// So much sooner a message gives way to its alternative than it would be given up, where others
// wait: by then the time of several of them may be as short. No measurement behind this value: with
// a third of it some of their alternatives are late, with twice as much messages give way that
// would have arrived (`interneuron bench load rate size`).
constexpr Duration kForAlternative = std::chrono::milliseconds(15);

// A path that is idle is tried with what takes at most so many halves of the time that there is.
constexpr int kHopedFor = 3;

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
  it->second.sent = SentPackets(std::max(first_number, unused_number_));
}

void Sender::remove_path(TimePoint now, LinkId path) {
  const auto it = paths_.find(path);
  if (it == paths_.end()) return;
  Path gone = std::move(it->second);
  paths_.erase(it);
  // Of what left over it nobody will tell.
  overdue_.remove_path(path);
  window_.remove_path(path);
  removed_at_ = now;
  unused_number_ = std::max(unused_number_, gone.sent.next_number());
  settle(now, path, gone.sent.in_flight());
  for (const MessageId id : gone.jobs.messages()) hand_on(now, gone.jobs, id);
  protect_touched(now);
}

void Sender::set_path(LinkId path, const PathView& view) {
  const auto it = paths_.find(path);
  if (it == paths_.end()) return;
  it->second.view = view;
  it->second.sent.set_ect(view.ect);
}

MessageId Sender::send(TimePoint now, const Times& times, wire::MessageBytes bytes,
                       const std::vector<LinkId>& paths, const PathSet& repairs,
                       wire::MessageKind kind, const Helpers& helpers) {
  parting_.clear();
  const MessageId id{next_message_++};
  if (paths.empty() || bytes.empty() || times.deadline <= now) return id;

  const std::size_t chunk = even_chunk(bytes.size(), piece_bytes(paths, repairs), helpers);
  const std::size_t count = (bytes.size() + chunk - 1) / chunk;
  if (count > UINT16_MAX) return id;
  Message& m = messages_.add(id, times.deadline, static_cast<std::uint16_t>(count),
                             static_cast<std::uint8_t>(helpers.divided ? 0 : paths.size()));
  m.chunk = static_cast<std::uint16_t>(chunk);
  m.aim = std::min(times.aim, times.deadline);
  m.doubt = times.doubt;
  m.importance = times.importance;
  m.lifetime_us = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(times.lifetime).count(), 1,
      UINT32_MAX));
  m.take(std::move(bytes), kind);
  m.repairs = repairs;
  m.symbol_paths = helpers.symbols;
  m.rescue = helpers.rescue;
  for (const LinkId path : paths) m.repairs.add(path);
  bytes_ += m.bytes.size();
  enqueue(now, m, paths, helpers.divided);
  if (!helpers.symbols.empty() && !can_wait(now, m)) protect(now, m, Protect::kAll);
  plan_rescue(now, m);
  return id;
}

std::uint64_t Sender::take_number(TimePoint now, LinkId link, std::size_t train_bytes) {
  SentPackets& sent = paths_.at(link).sent;
  return train_bytes > 0 ? sent.add(now, train_bytes, false, std::nullopt) : sent.add_small(now);
}

void Sender::complete(TimePoint now, MessageId message) {
  const Message* known = messages_.find(message);
  // Of copies nobody knows when the others would have been there.
  if (known != nullptr && known->paths == 1) note_not_brought(now, *known);
  forget_whole(message);
}

void Sender::supersede(MessageId better, MessageId worse) {
  if (Message* m = messages_.find(better)) m->inferior = worse;
}

void Sender::forget_whole(MessageId message) {
  std::optional<MessageId> next = message;
  while (next) {
    const MessageId id = *next;
    const Message* known = messages_.find(id);
    next = known != nullptr ? known->inferior : std::nullopt;
    forget(id);
  }
}

void Sender::forget(MessageId message) {
  for (auto& [link, path] : paths_) path.jobs.remove(message);
  const Message* known = messages_.find(message);
  if (known == nullptr) return;
  bytes_ -= known->held();
  const auto alternative = known->alternative;
  messages_.erase(message);
  // What was to stand in for it and has not begun never does. A plain message keeps it: each of its
  // variants is told of.
  const Message* other = alternative ? messages_.find(*alternative) : nullptr;
  if (other != nullptr && other->paths == 0 && other->kind == wire::MessageKind::kRound) {
    forget(other->id);
  }
}

Job* Sender::next_job(Path& path, TimePoint now) {
  while (Job* job = path.jobs.first()) {
    const MessageId id = job->message;
    if (job->pieces() == 0 || now >= job->deadline) {
      path.jobs.remove(id);
    } else if (can_arrive(now, path, *job, *messages_.find(id))) {
      return job;
    } else {
      give_up(path, *job);
    }
  }
  return nullptr;
}

bool Sender::can_arrive(TimePoint now, const Path& path, const Job& job,
                        const Message& message) const {
  // What comes too late over a path with room takes nothing from anybody, and tells the guard at
  // the other end how late it was.
  if (!path.view.loaded && !message.alternative) return true;
  if (!message.divided.empty() && !message.alternative) return together_can_arrive(now, message);
  const bool begun = job.next > 0 || message.is_alternative;
  const Duration least =
      flow::least_time(path.view, job.ip_bytes(), path.sent.bytes_in_flight(), begun);
  // What still has an alternative makes way for it while that can arrive, and those behind it.
  const bool makes_way = message.alternative && !begun && path.jobs.size() > 1;
  const Duration early = makes_way ? kForAlternative : Duration::zero();
  // A path on which nothing is under way may have become faster since; only what it is given tells.
  const bool is_idle = path.sent.bytes_in_flight() == 0 && path.jobs.size() == 1;
  const bool tries = is_idle && !message.alternative && !message.symbol_paths.empty();
  const Duration hoped = tries ? least / kHopedFor * 2 : least;
  return now + hoped + early <= message.deadline + message.doubt;
}

std::optional<JobQueue::Taken> Sender::take(Path& path, Job& job) {
  Message& m = *messages_.find(job.message);
  while (const auto taken = path.jobs.take(job)) {
    if (!m.pieces[taken->index].acknowledged) return taken;
    if (!taken->is_again) m.firsts_gone(1);
    m.copy_gone(taken->index);
  }
  return std::nullopt;
}

std::optional<Sender::Piece> Sender::poll(TimePoint now, LinkId path_id) {
  Path& path = paths_.at(path_id);
  if (!path.view.up) return std::nullopt;
  const bool idle = path.jobs.empty() && !window_.waits(path_id);
  if (idle) path.use.emptied(now);
  if (now < path.free_at || is_full(path)) {
    if (!idle) path.use.held_back();
    return std::nullopt;
  }
  if (const auto symbol = take_window_symbol(now, path_id, path)) return symbol;
  for (;;) {
    Job* job = next_job(path, now);
    while (job == nullptr && take_over(now, path_id, path)) job = next_job(path, now);
    if (job == nullptr) {
      path.idle_at = now;
      path.use.emptied(now);
      return std::nullopt;
    }
    const auto taken = take(path, *job);
    if (!taken) continue;

    Message& m = *messages_.find(job->message);
    const wire::MessageBytes::Part part = part_of(m, taken->index);
    const std::size_t ip_bytes = part.size() + kPieceOverheadBytes + kIpUdpBytes;
    const bool more_waits = job->pieces() > 0 || path.jobs.size() > 1;
    const std::uint64_t number =
        path.sent.add(now, ip_bytes, more_waits, SentPackets::Piece{m.id, taken->index});
    if (taken->index >= m.count) {
      ++path.symbols;
    } else if (taken->is_again) {
      ++path.resent;
    }
    note_leaving(now, path, m, *taken);
    occupy(now, path, ip_bytes);
    if (job->pieces() == 0) path.jobs.remove(m.id);
    if (path.jobs.empty() && !window_.waits(path_id)) path.use.emptied(now);
    return Piece{number, fragment_of(m, taken->index), part, nullptr, m.round};
  }
}

void Sender::occupy(TimePoint now, Path& path, std::size_t ip_bytes) {
  const Duration air = path.view.pace.value_or(kBlindPace).transmit_time(ip_bytes);
  path.free_at = std::max(path.free_at, now - kBurst) + std::min<Duration>(air, kLongestAir);
}

wire::FragmentHeader Sender::fragment_of(const Message& m, std::size_t index) {
  return {m.id,          static_cast<std::uint16_t>(index),
          m.chunk,       static_cast<std::uint32_t>(m.bytes.size()),
          m.lifetime_us, m.kind};
}

// Takes in what became of fragments: they are acknowledged, or lost and sent again.
void Sender::settle(TimePoint now, LinkId link, std::span<const SentPackets::Settled> pieces,
                    Evidence evidence) {
  for (const auto& [what, arrived, was_open] : pieces) {
    Message* message = messages_.find(what.message);
    if (message == nullptr && arrived) overdue_.arrived(what);
    if (message == nullptr) continue;
    if (was_open) {
      message->copy_gone(what.index);
      note_brought(now, link, *message, what.index);
    }
    if (message->pieces[what.index].acknowledged) continue;
    if (!arrived) {
      lose(now, *message, what.index, evidence);
      continue;
    }
    message->acknowledge(what.index);
    if (message->unacknowledged == 0) forget_whole(message->id);
  }
  protect_touched(now);
}

SentPackets::Verdicts Sender::report(TimePoint now, const wire::LinkReport& report,
                                     Duration min_rtt) {
  parting_.clear();
  const auto it = paths_.find(report.link);
  if (it == paths_.end()) return {};
  Path& path = it->second;
  const auto verdicts = path.sent.report(now, report, min_rtt, silence_of(path.view));
  settle(now, report.link, verdicts.pieces, Evidence::kReport);
  return verdicts;
}

PathUse::Told Sender::take_use(TimePoint now, LinkId link) {
  const auto it = paths_.find(link);
  return it == paths_.end() ? PathUse::Told{} : it->second.use.take(now);
}

DataRate Sender::needed() const {
  DataRate most{};
  for (const auto& [link, path] : paths_) most = std::max(most, path.use.needed());
  return most;
}

void Sender::handle_timeout(TimePoint now) {
  parting_.clear();
  for (auto& [link, path] : paths_) {
    const auto silent = path.sent.settle_silent(now, silence_of(path.view));
    path.use.lost(static_cast<std::uint32_t>(silent.size()));
    settle(now, link, silent);
  }
  while (const auto look = messages_.look_due(now)) {
    messages_.look_at(*look, std::nullopt);
    look_after(now, *messages_.find(*look));
  }
  if (window_.due() && *window_.due() <= now) send_window(now);
  while (const auto late = messages_.due(now)) {
    note_not_brought(now, *messages_.find(*late));
    note_overdue(now, *messages_.find(*late));
    forget(*late);
  }
}

void Sender::note_overdue(TimePoint now, const Message& message) {
  const TimePoint began = message.deadline - std::chrono::microseconds(message.lifetime_us);
  if (message.kind != wire::MessageKind::kPlain || began <= removed_at_) return;
  // Symbols may stand for a piece that has not arrived: then the peer tells.
  const bool is_coded = !message.symbols.empty() || message.in_window;
  if (is_coded && !message.is_surely_incomplete()) return;
  SentPackets::Piece missing{message.id, message.count};
  while (message.pieces[--missing.index].acknowledged) {
  }
  Overdue::Paths copies;
  for (const auto& [link, path] : paths_) {
    if (message.is_surely_incomplete()) break;
    // The lifetime is rounded to microseconds.
    const TimePoint since = began - std::chrono::microseconds(1);
    // A copy that nobody remembers may arrive as late as any.
    if (!path.sent.keeps_all_since(since)) return;
    const auto first = path.sent.first_copy(missing, since);
    if (first) copies.push_back({link, *first});
  }
  if (copies.empty() && !message.is_surely_incomplete()) return;
  overdue_.add(now, missing, message.deadline, copies);
}

std::optional<TimePoint> Sender::next_timeout() const {
  std::optional<TimePoint> next =
      earliest(messages_.next_deadline(), messages_.next_look(), window_.due());
  for (const auto& [link, path] : paths_) {
    next = earliest(next, path.sent.silent_at(silence_of(path.view)));
  }
  return next;
}

std::optional<TimePoint> Sender::next_send(LinkId path) const {
  const auto it = paths_.find(path);
  if (it == paths_.end() || !it->second.view.up) return std::nullopt;
  const Path& p = it->second;
  const bool is_idle = p.jobs.empty() && !window_.waits(path);
  if (is_idle && !slower_path(path, p)) return std::nullopt;
  // A report or a timeout makes room.
  if (is_full(p)) return std::nullopt;
  // What there is to take over since poll() found nothing, by what left another path, waits a
  // little: else the loop would be called again at the same instant.
  return saturating_add(is_idle ? std::max(p.free_at, p.idle_at) : p.free_at, kQuantum);
}

bool Sender::is_surely_incomplete(MessageId message) const {
  const Message* known = messages_.find(message);
  return known != nullptr && known->is_surely_incomplete();
}

// Where there is room for everything, the earliest deadline first is best for everything. Where
// there is not, it would serve what is due soonest and let the most important wait for it.
JobQueue::Turn Sender::turn_of(const Path& path, TimePoint deadline, std::uint8_t importance) {
  const std::uint8_t counts = path.view.loaded ? importance : kUsualImportance;
  return {static_cast<std::uint8_t>(UINT8_MAX - counts), deadline};
}

std::size_t Sender::queued_before(LinkId link, TimePoint deadline, std::uint8_t importance) const {
  const auto it = paths_.find(link);
  if (it == paths_.end()) return 0;
  return it->second.jobs.bytes_before(turn_of(it->second, deadline, importance));
}

std::uint64_t Sender::resent(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.resent;
}

std::uint64_t Sender::symbols(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.symbols;
}

std::uint64_t Sender::lost(LinkId path) const {
  const auto it = paths_.find(path);
  return it == paths_.end() ? 0 : it->second.sent.lost();
}

void Sender::reset(TimePoint now) {
  parting_.clear();
  messages_.clear();
  bytes_ = 0;
  overdue_.clear();
  window_.reset();
  given_up_.clear();
  for (auto& [link, path] : paths_) {
    path.jobs.clear();
    path.sent.reset();
    path.free_at = now;
  }
}

}  // namespace interneuron::flow
