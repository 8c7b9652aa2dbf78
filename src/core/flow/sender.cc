#include "core/flow/sender.h"

#include <algorithm>

#include "core/base/earliest.h"

namespace interneuron::flow {
namespace {

// How far apart acknowledgements of a slow link may come: a full packet takes 6 ms at 2 Mbit/s, and
// the receiver delays feedback by up to 5 ms.
constexpr Duration kMinBetween = std::chrono::milliseconds(15);

SentPackets::Silence silence_of(const PathView& view) {
  // An acknowledgement tells of packets sent a round trip ago. The packets sent right after those
  // should be acknowledged within the time that the timeout allows beyond a round trip.
  return {view.probe_timeout, std::max(view.probe_timeout - 2 * view.one_way, kMinBetween)};
}

}  // namespace

void Sender::add_path(LinkId link, std::size_t max_datagram, std::uint64_t first_number) {
  const auto [it, fresh] = traffic().paths.try_emplace(link);
  if (!fresh) return;
  it->second.max_datagram = max_datagram;
  it->second.sent = SentPackets(std::max(first_number, unused_number_));
}

void Sender::remove_path(TimePoint now, LinkId link) {
  const auto it = traffic().paths.find(link);
  if (it == traffic().paths.end()) return;
  SendPath gone = std::move(it->second);
  traffic().paths.erase(it);
  // What became of packets that left over it nobody will tell.
  overdue_.remove_path(link);
  traffic().window.remove_path(link);
  removed_at_ = now;
  unused_number_ = std::max(unused_number_, gone.sent.next_number());
  gone.sent.for_each_in_flight([&](const SentPackets::Piece& piece) {
    settle(now, link, {piece, false, true}, Evidence::kSilence);
  });
  executor_.protect_touched(now);
  for (const MessageId id : gone.jobs.messages()) executor_.hand_on(now, gone.jobs, id);
  executor_.protect_touched(now);
}

void Sender::set_path(LinkId link, const PathView& view) {
  SendPath* path = traffic().find(link);
  if (path == nullptr) return;
  path->view = view;
  path->sent.set_ect(view.ect);
}

void Sender::resize(TimePoint now, LinkId link, std::size_t max_datagram) {
  SendPath* path = traffic().find(link);
  if (path == nullptr || path->max_datagram == max_datagram) return;
  path->max_datagram = max_datagram;
  for (const MessageId id : path->jobs.messages()) {
    if (!path->can_carry(path->jobs.find(id)->chunk)) executor_.hand_on(now, path->jobs, id);
  }
  executor_.protect_touched(now);
}

void Sender::pull(TimePoint now, LinkId link) {
  SendPath* path = traffic().find(link);
  if (path == nullptr) return;
  path->view.up = false;
  executor_.send_elsewhere(now, link, nullptr);
}

void Sender::doubt(TimePoint now, LinkId link) {
  SendPath* path = traffic().find(link);
  if (path == nullptr) return;
  path->view.suspect = true;
  // Else nothing is better than to wait for it.
  if (traffic().any_is_sound()) executor_.send_elsewhere_what_fits(now, link);
}

MessageId Sender::send(TimePoint now, const Times& times, wire::MessageBytes bytes,
                       const PathList& paths, const PathSet& repairs, wire::MessageKind kind,
                       const Protection& protection) {
  executor_.release();
  const MessageId id{next_message_++};
  if (paths.empty() || bytes.empty() || times.deadline <= now) return id;

  const std::size_t chunk =
      even_chunk(traffic(), bytes.size(), traffic().piece_bytes(paths, repairs), protection);
  const std::size_t count = (bytes.size() + chunk - 1) / chunk;
  if (count > UINT16_MAX) return id;
  OutgoingMessage& m =
      traffic().messages.add(id, times.deadline, static_cast<std::uint16_t>(count),
                             static_cast<std::uint8_t>(protection.divided ? 0 : paths.size()));
  m.chunk = static_cast<std::uint16_t>(chunk);
  m.aim = std::min(times.aim, times.deadline);
  m.doubt = times.doubt;
  m.importance = times.importance;
  m.lifetime_us = wire::to_us(times.lifetime);
  m.take(std::move(bytes), kind);
  m.repairs = repairs;
  m.symbol_paths = protection.symbols;
  m.rescue = protection.rescue;
  for (const LinkId path : paths) m.repairs.add(path);
  traffic().bytes += m.bytes.size();
  executor_.enqueue(now, m, paths, protection.divided);
  if (!protection.symbols.empty() && !symbols_can_wait(traffic(), now, m)) {
    executor_.protect(now, m, Protect::kAll);
  }
  traffic().messages.look_at(id, next_look(traffic(), now, m));
  return id;
}

MessageId Sender::add_alternative(TimePoint now, MessageId first, wire::MessageBytes bytes,
                                  const PathSet& rescue) {
  const MessageId id{next_message_++};
  OutgoingMessage* other = traffic().messages.find(first);
  if (other == nullptr || bytes.empty()) return id;
  const std::size_t count = (bytes.size() + other->chunk - 1) / other->chunk;
  if (count > UINT16_MAX) return id;
  if (other->paths > 1 && rescue.empty()) return id;
  other->alternative = id;
  OutgoingMessage& m =
      traffic().messages.add(id, other->deadline, static_cast<std::uint16_t>(count), 0);
  // add() may have moved it.
  other = traffic().messages.find(first);
  m.chunk = other->chunk;
  m.aim = other->aim;
  m.doubt = other->doubt;
  m.importance = other->importance;
  m.lifetime_us = other->lifetime_us;
  m.repairs = other->repairs;
  m.take(std::move(bytes), other->kind);
  traffic().bytes += m.bytes.size();
  m.is_alternative = true;
  m.rescue = rescue;
  traffic().messages.look_at(first, next_look(traffic(), now, *other));
  return id;
}

void Sender::supersede(MessageId better, MessageId worse) {
  if (OutgoingMessage* m = traffic().messages.find(better)) m->inferior = worse;
}

void Sender::complete(TimePoint now, MessageId message) {
  const OutgoingMessage* known = traffic().messages.find(message);
  // Where copies went over several paths, nobody knows when the others would have been there.
  if (known != nullptr && known->paths == 1) executor_.note_not_brought(now, *known);
  executor_.forget_whole(message);
}

void Sender::settle_overdue(std::span<const wire::LinkReport> reports,
                            std::optional<TimePoint> left) {
  for (const wire::LinkReport& report : reports) {
    if (traffic().paths.contains(report.link)) overdue_.report(report, left);
  }
}

std::uint64_t Sender::take_number(TimePoint now, LinkId link, std::size_t train_bytes) {
  SentPackets& sent = traffic().paths.at(link).sent;
  return train_bytes > 0 ? sent.add(now, train_bytes, false, std::nullopt) : sent.add_small(now);
}

std::uint64_t Sender::take_mtu_probe_number(TimePoint now, LinkId link, std::size_t ip_bytes) {
  return traffic().paths.at(link).sent.add_mtu_probe(now, ip_bytes);
}

// The first job of a path that can arrive in time; those before it are given up.
Job* Sender::next_job(TimePoint now, LinkId link, SendPath& path) {
  while (Job* job = path.jobs.first()) {
    const MessageId id = job->message;
    if (job->pieces() == 0 || now >= job->deadline) {
      path.jobs.remove(id);
    } else if (traffic().can_arrive(now, path, *job, *traffic().messages.find(id))) {
      return job;
    } else {
      executor_.give_up(link, *job);
    }
  }
  return nullptr;
}

// The next fragment of a job that is not acknowledged yet.
std::optional<JobQueue::Taken> Sender::take(SendPath& path, Job& job) {
  OutgoingMessage& m = *traffic().messages.find(job.message);
  while (const auto taken = path.jobs.take(job)) {
    if (!m.pieces[taken->index].acknowledged) return taken;
    if (!taken->is_again) m.firsts_gone(1);
    m.copy_gone(taken->index);
  }
  return std::nullopt;
}

std::optional<Sender::Piece> Sender::poll(TimePoint now, LinkId link) {
  SendPath& path = traffic().paths.at(link);
  const WindowFlow& window = traffic().window;
  if (!path.view.up) return std::nullopt;
  const bool idle = path.jobs.empty() && !window.waits(link);
  if (idle) path.use.emptied(now);
  if (now < path.free_at || path.is_full()) {
    if (!idle) path.use.held_back();
    return std::nullopt;
  }
  if (const auto symbol = take_window_symbol(now, link, path)) return symbol;
  for (;;) {
    Job* job = next_job(now, link, path);
    while (job == nullptr && executor_.take_over(now, link)) job = next_job(now, link, path);
    if (job == nullptr) {
      path.idle_at = now;
      path.use.emptied(now);
      return std::nullopt;
    }
    const auto taken = take(path, *job);
    if (!taken) continue;

    OutgoingMessage& m = *traffic().messages.find(job->message);
    const wire::MessageBytes::Part part = m.part(taken->index);
    const std::size_t ip_bytes = ip_bytes_of_piece(part.size());
    const bool more_waits = job->pieces() > 0 || path.jobs.size() > 1;
    const std::uint64_t number =
        path.sent.add(now, ip_bytes, more_waits, SentPackets::Piece{m.id, taken->index});
    if (taken->index >= m.count) {
      ++path.symbols;
    } else if (taken->is_again) {
      ++path.resent;
    }
    executor_.note_leaving(now, link, m, *taken);
    path.occupy(now, ip_bytes);
    if (job->pieces() == 0) path.jobs.remove(m.id);
    if (path.jobs.empty() && !window.waits(link)) path.use.emptied(now);
    return Piece{number, m.fragment(taken->index), part, nullptr, m.round};
  }
}

// A symbol that waits for this path leaves before what the path has to send else: it has waited for
// as long as it could.
std::optional<Sender::Piece> Sender::take_window_symbol(TimePoint now, LinkId link,
                                                        SendPath& path) {
  while (WindowFlow::Symbol* symbol = traffic().window.front(link)) {
    symbol->waits = false;
    if (symbol->until < now) continue;
    // It counts as in flight, as a piece of a message that nobody knows.
    const SentPackets::Piece piece{MessageId{next_message_++}, 0};
    const std::size_t ip_bytes = symbol->ip_bytes();
    const std::uint64_t number = path.sent.add(now, ip_bytes, !path.jobs.empty(), piece);
    ++path.symbols;
    path.occupy(now, ip_bytes);
    if (path.jobs.empty() && !traffic().window.waits(link)) path.use.emptied(now);
    return Piece{number, {}, {{}, ByteView(symbol->bytes)}, &symbol->header};
  }
  return std::nullopt;
}

// Takes in what became of a fragment: it is acknowledged, or lost and sent again.
void Sender::settle(TimePoint now, LinkId link, const SentPackets::Settled& settled,
                    Evidence evidence) {
  const auto& [what, arrived, was_open] = settled;
  OutgoingMessage* m = traffic().messages.find(what.message);
  if (m == nullptr && arrived) overdue_.arrived(what);
  if (m == nullptr) return;
  if (was_open) executor_.note_settled(now, link, *m, what.index);
  if (m->pieces[what.index].acknowledged) return;
  if (!arrived) {
    executor_.lose(now, *m, what.index, evidence);
    return;
  }
  m->acknowledge(what.index);
  if (m->unacknowledged == 0) executor_.forget_whole(m->id);
}

SentPackets::Verdicts Sender::report(TimePoint now, const wire::LinkReport& report,
                                     Duration min_rtt) {
  executor_.release();
  SendPath* path = traffic().find(report.link);
  if (path == nullptr) return {};
  const auto verdicts = path->sent.report(now, report, min_rtt, silence_of(path->view));
  for (const auto& settled : verdicts.pieces) {
    settle(now, report.link, settled, Evidence::kReport);
  }
  executor_.protect_touched(now);
  return verdicts;
}

void Sender::handle_timeout(TimePoint now) {
  executor_.release();
  MessageStore& messages = traffic().messages;
  for (auto& [link, path] : traffic().paths) {
    const auto silent = path.sent.settle_silent(now, silence_of(path.view));
    path.use.lost(static_cast<std::uint32_t>(silent.size()));
    for (const auto& settled : silent) settle(now, link, settled, Evidence::kSilence);
    executor_.protect_touched(now);
  }
  while (const auto look = messages.look_due(now)) {
    messages.look_at(*look, std::nullopt);
    executor_.look_after(now, *messages.find(*look));
  }
  const auto window_due = traffic().window.due();
  if (window_due && *window_due <= now) executor_.send_window(now);
  while (const auto late = messages.due(now)) {
    executor_.note_not_brought(now, *messages.find(*late));
    note_overdue(now, *messages.find(*late));
    executor_.forget(*late);
  }
}

// The deadline of a message has passed before it was acknowledged.
void Sender::note_overdue(TimePoint now, const OutgoingMessage& m) {
  // The lifetime is rounded up, so that nothing of the message left before this.
  const TimePoint began = m.deadline - std::chrono::microseconds(m.lifetime_us);
  if (m.kind != wire::MessageKind::kPlain || began <= removed_at_) return;
  // Symbols may stand for a piece that has not arrived: then the peer tells.
  const bool is_coded = !m.symbols.empty() || m.in_window;
  const bool is_incomplete = m.is_surely_incomplete();
  if (is_coded && !is_incomplete) return;
  SentPackets::Piece missing{m.id, m.count};
  while (m.pieces[--missing.index].acknowledged) {
  }
  Overdue::Paths copies;
  for (const auto& [link, path] : traffic().paths) {
    if (is_incomplete) break;
    // A copy that nobody remembers may arrive as late as any.
    if (!path.sent.keeps_all_since(began)) return;
    const auto first = path.sent.first_copy(missing, began);
    if (first) copies.push_back({link, *first});
  }
  if (copies.empty() && !is_incomplete) return;
  overdue_.add(now, missing, m.deadline, copies);
}

std::optional<TimePoint> Sender::next_timeout() const {
  const MessageStore& messages = traffic().messages;
  std::optional<TimePoint> next =
      earliest(messages.next_deadline(), messages.next_look(), traffic().window.due());
  for (const auto& [link, path] : traffic().paths) {
    next = earliest(next, path.sent.silent_at(silence_of(path.view)));
  }
  return next;
}

std::optional<TimePoint> Sender::next_send(LinkId link) const {
  const SendPath* path = traffic().find(link);
  if (path == nullptr || !path->view.up) return std::nullopt;
  const bool is_idle = path->jobs.empty() && !traffic().window.waits(link);
  if (is_idle && !slower_path(traffic(), link)) return std::nullopt;
  // A report or a timeout makes room.
  if (path->is_full()) return std::nullopt;
  // What there is to take over since poll() found nothing, by what left another path, waits a
  // little: else the loop would be called again at the same instant.
  if (is_idle) return saturating_add(std::max(path->free_at, path->idle_at), kQuantum);
  const Duration batch = traffic().batch(*path);
  return saturating_add(path->free_at,
                        traffic().window.waits(link) ? std::min(batch, kQuantum) : batch);
}

bool Sender::is_surely_incomplete(MessageId message) const {
  const OutgoingMessage* known = traffic().messages.find(message);
  return known != nullptr && known->is_surely_incomplete();
}

std::size_t Sender::queued_before(LinkId link, TimePoint deadline, std::int16_t importance) const {
  const SendPath* path = traffic().find(link);
  return path == nullptr ? 0 : path->jobs.bytes_before(path->turn_of(deadline, importance));
}

std::optional<Duration> Sender::least_time(LinkId link, std::size_t ip_bytes) const {
  const SendPath* path = traffic().find(link);
  if (path == nullptr || !path->view.loaded) return std::nullopt;
  return path->least_time(ip_bytes, false);
}

Duration Sender::possible_time(TimePoint now, LinkId link, std::size_t ip_bytes) const {
  const SendPath* path = traffic().find(link);
  return path == nullptr ? Duration::zero() : path->possible_time(now, ip_bytes);
}

PathUse::Told Sender::take_use(TimePoint now, LinkId link) {
  SendPath* path = traffic().find(link);
  return path == nullptr ? PathUse::Told{} : path->use.take(now);
}

DataRate Sender::needed() const {
  DataRate most{};
  for (const auto& [link, path] : traffic().paths) most = std::max(most, path.use.needed());
  return most;
}

std::uint64_t Sender::resent(LinkId link) const {
  const SendPath* path = traffic().find(link);
  return path == nullptr ? 0 : path->resent;
}

std::uint64_t Sender::symbols(LinkId link) const {
  const SendPath* path = traffic().find(link);
  return path == nullptr ? 0 : path->symbols;
}

std::uint64_t Sender::lost(LinkId link) const {
  const SendPath* path = traffic().find(link);
  return path == nullptr ? 0 : path->sent.lost();
}

}  // namespace interneuron::flow
