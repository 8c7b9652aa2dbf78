#include "core/flow/executor.h"

#include <algorithm>
#include <array>
#include <utility>

#include "core/code/field.h"
#include "core/wire/source.h"

namespace interneuron::flow {

void Executor::enqueue(TimePoint now, OutgoingMessage& m, const PathList& paths, bool divided) {
  Shares parts;
  parts.fill(m.count);
  if (divided) parts = plan_shares(traffic_, now, m, paths);
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (parts[i] == 0) continue;
    const std::uint32_t from = divided ? next : 0;
    next = from + parts[i];
    SendPath& path = traffic_.paths.at(paths[i]);
    const Way way = path.way_of(m);
    const Duration air = way.rate.transmit_time(parts[i] * m.ip_bytes_of_piece());
    m.shares.push_back({paths[i], from, next, parts[i], now + way.delay + air, air});
    if (m.importance == kBulkImportance) {
      path.use.queued(now);
    } else {
      path.use.message(now, parts[i] * std::size_t{m.chunk}, m.deadline - now);
    }
    path.jobs.add(m.id, path.turn_of(m), from, static_cast<std::uint16_t>(next), m.chunk);
    m.taken.add(paths[i]);
    if (divided) {
      for (std::uint32_t p = from; p < next; ++p) m.copy_added(p);
    }
    m.to_leave += parts[i];
  }
  if (!divided) return;
  m.paths = 1;
  m.divided = PathSet::of(paths);
}

void Executor::forget_whole(MessageId message) {
  std::optional<MessageId> next = message;
  while (next) {
    const MessageId id = *next;
    const OutgoingMessage* known = find(id);
    next = known != nullptr ? known->inferior : std::nullopt;
    forget(id);
  }
}

void Executor::forget(MessageId message) {
  for (auto& [link, path] : traffic_.paths) path.jobs.remove(message);
  const OutgoingMessage* known = find(message);
  if (known == nullptr) return;
  traffic_.bytes -= known->held();
  const auto alternative = known->alternative;
  traffic_.messages.erase(message);
  // What was to stand in for it and has not begun never does. A plain message keeps it: each of its
  // variants is told of.
  const OutgoingMessage* other = find(alternative);
  if (other != nullptr && other->paths == 0 && other->kind == wire::MessageKind::kRound) {
    forget(other->id);
  }
}

void Executor::give_up(LinkId link, Job& job) {
  const MessageId id = job.message;
  OutgoingMessage& message = *find(id);
  job.for_each([this, &message](std::uint16_t index) {
    message.copy_gone(index);
    if (!message.pieces[index].acknowledged) ++cancelled_;
  });
  const bool all_left = job.next >= job.count;
  message.firsts_gone(job.firsts());
  traffic_.paths.at(link).jobs.remove(id);
  // Where all of it has left, what was to be sent again may be there after all.
  if (message.paths > 1 || all_left || !message.is_surely_incomplete()) return;
  // What another path has of it may complete it.
  const bool waits_elsewhere = std::ranges::any_of(traffic_.paths, [id](const auto& entry) {
    const Job* other = entry.second.jobs.find(id);
    return other != nullptr && other->pieces() > 0;
  });
  if (waits_elsewhere) return;
  // Nobody else completes it, so nothing of it is sent again.
  if (message.kind == wire::MessageKind::kPlain) given_up_.push_back(id);
  const auto alternative = std::exchange(message.alternative, std::nullopt);
  traffic_.bytes -= message.held();
  parting_.push_back(std::exchange(message.bytes, {}).payload);
  for (Bytes& symbol : std::exchange(message.symbols, {})) parting_.push_back(std::move(symbol));
  forget(id);
  if (OutgoingMessage* next = find(alternative)) begin_alternative(link, *next);
}

std::optional<MessageId> Executor::poll_given_up() {
  if (given_up_.empty()) return std::nullopt;
  const MessageId message = given_up_.front();
  given_up_.pop_front();
  return message;
}

// An alternative sets out over this path.
void Executor::begin_alternative(LinkId over, OutgoingMessage& m) {
  SendPath& path = traffic_.paths.at(over);
  m.paths = 1;
  for (std::uint16_t i = 0; i < m.count; ++i) m.copy_added(i);
  m.taken = PathSet::of(std::array{over});
  m.to_leave = m.count;
  path.jobs.add(m.id, path.turn_of(m), 0, m.count, m.chunk);
}

bool Executor::take_over(TimePoint now, LinkId idle) {
  const auto from = slower_path(traffic_, idle);
  if (!from) return false;
  SendPath& path = traffic_.paths.at(idle);
  SendPath& other = traffic_.paths.at(*from);
  Job& job = *other.jobs.first();
  OutgoingMessage& m = *find(job.message);
  const std::uint16_t index = other.jobs.take_last(job);
  m.leave_out(*from, index);
  path.use.queued(now);
  path.jobs.add(m.id, path.turn_of(m), index, static_cast<std::uint16_t>(index + 1), m.chunk);
  m.taken.add(idle);
  return true;
}

void Executor::note_leaving(TimePoint now, LinkId link, OutgoingMessage& m,
                            const JobQueue::Taken& taken) {
  m.copy_left(taken.index);
  if (!taken.is_again) m.firsts_gone(1);
  if (m.symbol_paths.empty()) return;
  m.set_last(taken.index, traffic_.is_last(now, traffic_.paths.at(link), m));
  if (taken.is_again || m.to_leave > 0 || join_window(now, m)) return;
  protect(now, m, Protect::kLast);
}

// The path learns from the last of the fragments that it was given at first how far off it was.
void Executor::note_settled(TimePoint now, LinkId link, OutgoingMessage& m, std::uint16_t index) {
  m.copy_gone(index);
  for (OutgoingMessage::Share& share : m.shares) {
    if (share.path != link || index < share.from || index >= share.to || share.open == 0) continue;
    if (--share.open == 0) learn(now, share);
  }
}

void Executor::note_not_brought(TimePoint now, const OutgoingMessage& m) {
  for (const OutgoingMessage::Share& share : m.shares) {
    if (share.open > 0) learn(now, share);
  }
}

// What was told now was there one way earlier.
void Executor::learn(TimePoint now, const OutgoingMessage::Share& share) {
  SendPath* path = traffic_.find(share.path);
  if (path == nullptr) return;
  path->law.learn(now - path->view.least_one_way - share.eta, share.air);
}

// Where as many others are under way as the peer needs, nothing is sent for a lost copy; what their
// own losses may cost is weighed once for all that a report has told.
void Executor::lose(TimePoint now, OutgoingMessage& m, std::uint16_t index, Evidence evidence) {
  const bool is_needed = m.symbol_paths.empty() || m.spare(m.division().block_of(index)) < 0;
  if (is_needed && !gives_way(traffic_, now, m, evidence)) repair(now, m, index, evidence);
  touch(m);
}

bool Executor::repair(TimePoint now, OutgoingMessage& m, std::uint16_t index, Evidence evidence) {
  const RepairOrder order = plan_repair(traffic_, now, m, index, evidence);
  if (order.is_too_late) ++cancelled_;
  if (order.first) queue_again(now, *order.first, m, index);
  if (order.second) queue_again(now, *order.second, m, index);
  return order.first.has_value();
}

void Executor::queue_again(TimePoint now, LinkId over, OutgoingMessage& m, std::uint16_t index) {
  SendPath& path = traffic_.paths.at(over);
  m.copy_added(index);
  if (traffic_.is_last(now, path, m)) m.set_last(index, true);
  path.use.queued(now);
  Job* job = path.jobs.find(m.id);
  if (job == nullptr) job = &path.jobs.add(m.id, path.turn_of(m), m.count, m.count, m.chunk);
  path.jobs.push_again(*job, index);
}

void Executor::touch(const OutgoingMessage& m) {
  if (m.symbol_paths.empty()) return;
  if (std::ranges::find(touched_, m.id) == touched_.end()) touched_.push_back(m.id);
}

void Executor::protect_touched(TimePoint now) {
  for (const MessageId id : touched_) {
    OutgoingMessage* m = find(id);
    if (m != nullptr && !m->in_window) protect(now, *m, Protect::kLast);
  }
  touched_.clear();
}

// While more of a message is to leave, what is lost of it is asked for again.
void Executor::protect(TimePoint now, OutgoingMessage& m, Protect what) {
  for (std::size_t b = 0; b < m.blocks.size(); ++b) {
    const auto order = plan_symbols(traffic_, now, m, b, what);
    if (!order) continue;
    const std::size_t first = m.blocks[b].rows;
    m.make_symbols(b, order->count, scratch_);
    traffic_.bytes += order->count * m.chunk;
    for (std::size_t row = first; row < m.blocks[b].rows; ++row) {
      const auto index = static_cast<std::uint16_t>(m.division().symbol_at(b, row));
      queue_again(now, order->path, m, index);
    }
  }
}

// All of a message has left. True: windows cover it, and it needs no symbols of its own.
bool Executor::join_window(TimePoint now, OutgoingMessage& m) {
  WindowFlow& window = traffic_.window;
  if (!is_for_windows(m) || !window.is_understood()) return false;
  window.note_left(now);
  if (m.blocks[0].last == 0 || m.blocks[0].rows > 0) return false;
  const auto latest = window_latest(traffic_, m, m.aim);
  if (!latest || *latest < now) return false;
  const auto next = window.next();
  if (!window.has_room(m.count)) send_window(now);
  if (window.pending().empty() && (!next || *next > *latest)) return false;
  m.in_window = true;
  window.add(m.id, m.count, *latest);
  const bool can_wait = next && *next <= *window.due() && window.has_room(m.count);
  if (!can_wait) send_window(now);
  return true;
}

void Executor::send_window(TimePoint now) {
  const WindowFlow::Pending pending = traffic_.window.pending();
  traffic_.window.clear_pending();
  for (const MessageId id : pending) {
    if (OutgoingMessage* m = find(id)) m->in_window = false;
  }
  const auto order = plan_window(traffic_, now, pending);
  if (!order) return;
  for (const auto& covered : order->header.messages) find(covered.message)->in_window = true;
  for (std::size_t i = 0; i < order->count; ++i) add_window_symbol(*order);
  traffic_.paths.at(order->path).use.queued(now);
}

void Executor::add_window_symbol(const WindowOrder& order) {
  WindowFlow::Symbol& symbol = traffic_.window.push();
  symbol.path = order.path;
  symbol.until = order.until;
  symbol.header = order.header;
  symbol.header.row = traffic_.window.next_row();
  symbol.bytes.assign(wire::kSourceHeaderBytes + order.longest, std::byte{0});
  symbol.header.for_each([&](std::size_t column, MessageId id, std::uint8_t index) {
    const OutgoingMessage& m = *find(id);
    const std::uint8_t factor = code::coefficient(symbol.header.row, column);
    std::span<std::byte> to(symbol.bytes);
    const auto add = [&to, factor](ByteView from) {
      code::add_multiple(to, from, factor);
      to = to.subspan(from.size());
    };
    add(wire::source_header(m.fragment(index)));
    const wire::MessageBytes::Part part = m.part(index);
    add(part.header);
    add(part.payload);
  });
}

void Executor::look_after(TimePoint now, OutgoingMessage& m) {
  const auto order = plan_rescue(traffic_, now, m);
  if (!order) {
    traffic_.messages.look_at(m.id, next_look(traffic_, now + kRescueMargin, m));
  } else if (!order->by_alternative) {
    rescue(now, order->path, m);
  } else {
    OutgoingMessage& other = *find(std::exchange(m.alternative, std::nullopt));
    traffic_.paths.at(order->path).use.queued(now);
    begin_alternative(order->path, other);
  }
}

// What is missing of a message goes over this path as well.
void Executor::rescue(TimePoint now, LinkId over, OutgoingMessage& m) {
  m.rescue = {};
  if (OutgoingMessage* other = find(m.alternative)) other->rescue = {};
  for (const std::uint16_t index : missing_on(traffic_.paths.at(over), m)) {
    queue_again(now, over, m, index);
  }
}

void Executor::hand_on(TimePoint now, JobQueue& jobs, MessageId id) {
  OutgoingMessage& m = *find(id);
  m.firsts_gone(jobs.find(id)->firsts());
  const std::vector<std::uint16_t> indices = jobs.take_all(*jobs.find(id));
  jobs.remove(id);
  for (const std::uint16_t index : indices) {
    m.copy_gone(index);
    const OutgoingMessage::PieceState& piece = m.pieces[index];
    if (!piece.acknowledged && piece.under_way == 0) repair(now, m, index);
  }
  touch(m);
}

void Executor::send_elsewhere_what_fits(TimePoint now, LinkId link) {
  std::vector<MessageId> moving;
  for (const auto& [id, pieces] : owed_by(traffic_, traffic_.paths.at(link))) {
    OutgoingMessage& m = *find(id);
    const MoveOrder order = plan_move(traffic_, now, link, m, pieces);
    if (order.rescue) rescue(now, *order.rescue, m);
    if (order.moves) moving.push_back(id);
  }
  send_elsewhere(now, link, &moving);
}

void Executor::send_elsewhere(TimePoint now, LinkId link, const std::vector<MessageId>* only) {
  SendPath& path = traffic_.paths.at(link);
  const auto moves = [only](MessageId id) {
    return only == nullptr || std::ranges::find(*only, id) != only->end();
  };
  // What is in flight is queued again but not settled as lost: it may have arrived, and then its
  // acknowledgement saves the second copy.
  path.sent.for_each_in_flight([&](const SentPackets::Piece& piece) {
    OutgoingMessage* m = find(piece.message);
    if (m == nullptr || !moves(piece.message)) return;
    if (!m->pieces[piece.index].acknowledged) repair(now, *m, piece.index);
    touch(*m);
  });
  for (const MessageId id : path.jobs.messages()) {
    if (!moves(id)) continue;
    OutgoingMessage& m = *find(id);
    // No other job is added to this path meanwhile, because nothing is repaired over it.
    Job& job = *path.jobs.find(id);
    m.firsts_gone(job.firsts());
    for (const std::uint16_t index : path.jobs.take_all(job)) {
      m.copy_gone(index);
      if (m.pieces[index].acknowledged || repair(now, m, index)) continue;
      // No other path brings it in time: it waits here for this path to come back.
      m.copy_added(index);
      path.jobs.push_again(job, index);
    }
    touch(m);
  }
  protect_touched(now);
}

void Executor::reset(TimePoint now) {
  parting_.clear();
  given_up_.clear();
  traffic_.messages.clear();
  traffic_.bytes = 0;
  traffic_.window.reset();
  for (auto& [link, path] : traffic_.paths) {
    path.jobs.clear();
    path.sent.reset();
    path.free_at = now;
  }
}

}  // namespace interneuron::flow
