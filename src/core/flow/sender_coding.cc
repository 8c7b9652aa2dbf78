// Repair symbols of messages: when they are worth their bytes, how many, and over which path.
//
// What is lost early in a message is reported in time to be sent again, which costs least. What
// leaves so late that its loss would be known too late to send it once more is in its last round
// (PieceState::last), and symbols alone can make that good. They leave when all of the message has
// left, because then it is known what of it was lost before; over another path than the message if
// one is in time, because what loses pieces loses symbols beside them.
#include <algorithm>
#include <array>

#include "core/code/erasure_code.h"
#include "core/code/redundancy.h"
#include "core/flow/piece_layout.h"
#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// How long after its time an arrival is reported at the latest (src/core/peers/feedback_due.h), so
// that a loss is known so much later than a round trip.
constexpr Duration kReportDelay = std::chrono::milliseconds(5);
// Symbols have to be there so much before the deadline. No measurement behind this value: it only
// has to be more than a batch of packets takes.
constexpr Duration kMargin = std::chrono::milliseconds(2);
// Proactive symbols take at most this part of a message, and one more: bursts are geometric at
// best, and what covers nearly all of them costs more bytes than a copy on another path is worth.
constexpr std::size_t kMostPart = 7;
// By how many times what its delay varies another path must be sooner than symbols are needed: as
// in the timeouts of RFC 6298.
constexpr int kDeviations = 4;
// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);

}  // namespace

wire::MessageBytes::Part Sender::part_of(const Message& m, std::size_t index) {
  if (index >= m.count) return {{}, ByteView(m.symbols[index - m.count])};
  const std::size_t offset = index * m.chunk;
  return m.bytes.part(offset, std::min<std::size_t>(m.chunk, m.bytes.size() - offset));
}

// A loss is known a round trip and a report later; the copy then takes one way more, and its own
// time on the air, which is long on a slow path. Where too few packets follow to tell of it, it may
// take until the timeout; to be in time for the deadline is enough then.
bool Sender::is_last(TimePoint now, const Path& path, const Message& m) const {
  if (m.symbol_paths.empty()) return false;
  Duration back = kNever;
  for (const auto& [link, other] : paths_) {
    if (!other.view.up || !m.repairs.contains(link)) continue;
    const DataRate rate = other.view.rate.value_or(kBlindRate);
    const Duration air = std::min<Duration>(rate.transmit_time(ip_bytes_of_piece(m)), kNever);
    back = std::min<Duration>(back, other.view.one_way + air);
  }
  const TimePoint told = now + 2 * path.view.one_way + kReportDelay;
  if (told + back + kMargin > m.aim) return true;
  // Behind a message of a round there is more to do: what is there by the deadline alone helps
  // none.
  const bool is_tail = m.kind == wire::MessageKind::kPlain &&
                       path.jobs.bytes() < SentPackets::kReorderPackets * m.chunk;
  return is_tail && now + path.view.probe_timeout + back + kMargin > m.deadline;
}

bool Sender::can_wait(TimePoint now, const Message& m) {
  TimePoint all_left = now;
  std::size_t own = 0;
  for (auto& [link, path] : paths_) {
    const Job* job = path.jobs.find(m.id);
    if (job == nullptr) continue;
    own = std::max(own, job->ip_bytes());
    const DataRate pace = path.view.pace.value_or(kBlindPace);
    all_left =
        std::max(all_left, now + std::min<Duration>(pace.transmit_time(path.jobs.bytes()), kNever));
  }
  return symbol_path(all_left, m, own / kMostPart, m.aim) != nullptr;
}

// Whether symbols take nothing from other messages: the path carries less than it can, or no other
// message waits for it.
bool Sender::has_room(const Path& path, const Message& m) {
  const std::size_t own = path.jobs.find(m.id) == nullptr ? 0 : 1;
  return !path.view.loaded || path.jobs.size() <= own;
}

// The path that brings so many bytes of symbols in time if they are queued at `when`, of those that
// the message itself does not take if there is one.
Sender::Path* Sender::symbol_path(TimePoint when, const Message& m, std::size_t bytes,
                                  TimePoint target) {
  Path* best = nullptr;
  TimePoint soonest{};
  bool best_is_own = false;
  for (auto& [link, path] : paths_) {
    const bool may_carry = m.symbol_paths.contains(link) && path.view.up && has_room(path, m) &&
                           path.max_datagram >= m.chunk + kPieceOverheadBytes;
    if (!may_carry) continue;
    const DataRate rate = path.view.rate.value_or(kBlindRate);
    const bool is_own = m.taken.contains(link);
    const std::size_t ahead = is_own ? 0 : path.jobs.bytes();
    const TimePoint arrival =
        when + std::min<Duration>(rate.transmit_time(ahead + bytes), kNever) + path.view.one_way;
    // Another path has to be in time surely: one of its own is known to deliver just now.
    const Duration doubt = is_own ? Duration::zero() : kDeviations * path.view.jitter;
    if (arrival + doubt + kMargin > target || (path.view.suspect && !is_own)) continue;
    if (best == nullptr || std::pair(is_own, arrival) < std::pair(best_is_own, soonest)) {
      best = &path;
      soonest = arrival;
      best_is_own = is_own;
    }
  }
  return best;
}

// A copy leaves. When it was the last first copy of its message, symbols follow.
void Sender::note_leaving(TimePoint now, Path& path, Message& m, const JobQueue::Taken& taken) {
  m.copy_left(taken.index);
  if (!taken.is_again) m.firsts_gone(1);
  if (m.symbol_paths.empty()) return;
  m.set_last(taken.index, is_last(now, path, m));
  if (taken.is_again || m.to_leave > 0 || join_window(now, m)) return;
  protect(now, m, Protect::kLast);
}

// A copy is lost. Where as many others are under way as the peer needs, nothing is sent for it;
// what their own losses may cost is weighed once for all that a report has told.
void Sender::lose(TimePoint now, Message& m, std::uint16_t index, Evidence evidence) {
  if (m.symbol_paths.empty()) {
    if (!makes_way(now, m, evidence)) repair(now, m.id, index, evidence);
    return;
  }
  const bool is_needed = m.spare(m.division().block_of(index)) < 0;
  if (is_needed && !makes_way(now, m, evidence)) repair(now, m.id, index, evidence);
  touch(m);
}

// What may be lost of the message has changed: symbols are weighed anew.
void Sender::touch(const Message& m) {
  const bool known = std::ranges::find(touched_, m.id) != touched_.end();
  if (!m.symbol_paths.empty() && !known) touched_.push_back(m.id);
}

// In silence a whole message seems lost. Where a smaller variant stands by and all that is missing
// cannot be in time elsewhere, a part of it would only be in that variant's way.
bool Sender::makes_way(TimePoint now, const Message& m, Evidence evidence) {
  if (evidence == Evidence::kReport || !m.alternative) return false;
  const Message* other = messages_.find(*m.alternative);
  if (other == nullptr || other->rescue.empty()) return false;
  const auto chance = last_chance(m, m.repairs, nullptr, missing_bytes(m), m.deadline);
  return !chance || chance->arrival < now;
}

void Sender::protect_touched(TimePoint now) {
  for (const MessageId id : touched_) {
    Message* m = messages_.find(id);
    if (m != nullptr && !m->in_window) protect(now, *m, Protect::kLast);
  }
  touched_.clear();
}

void Sender::protect(TimePoint now, Message& m, Protect what) {
  // While more of it is to leave, that is asked for again.
  for (std::size_t b = 0; b < m.blocks.size(); ++b) {
    const Message::Block& block = m.blocks[b];
    const std::size_t pieces = m.division().pieces(b);
    // What is known to be lost is made good beyond that.
    const std::size_t lost = pieces + block.rows - block.acknowledged - block.under_way;
    const std::size_t most = std::min<std::size_t>(pieces / kMostPart + 1 + lost, code::kMostRows);
    const std::size_t at_risk = what == Protect::kAll ? block.under_way : block.last;
    if (at_risk == 0 || block.rows >= most || m.spare(b) < 0) continue;
    code::Losses losses;
    for (const auto& [link, path] : paths_) {
      const code::Losses& there = path.view.losses;
      const bool carries = m.taken.contains(link) || path.jobs.find(m.id) != nullptr;
      if (carries && there.share > losses.share) losses = there;
    }
    const double value = (1.0 + m.importance) / (1.0 + kUsualImportance);
    const double price = kPriceOfBytes / static_cast<double>(m.count) / value;
    const std::size_t more = code::symbols_for(at_risk, static_cast<std::size_t>(m.spare(b)),
                                               losses, price, most - block.rows);
    if (more == 0) continue;
    Path* path = symbol_path(now, m, more * m.chunk, m.aim);
    if (path == nullptr) path = symbol_path(now, m, more * m.chunk, m.deadline);
    if (path != nullptr) add_symbols(now, m, *path, b, more);
  }
}

void Sender::add_symbols(TimePoint now, Message& m, Path& path, std::size_t b, std::size_t count) {
  const code::Blocks division = m.division();
  const PieceLayout layout{m.bytes.size(), m.bytes.header.size(), m.chunk};
  const std::size_t first = m.blocks[b].rows;
  if (division.symbol_at(b, first + count - 1) > UINT16_MAX) return;
  std::size_t odd = 0;
  for (std::size_t c = 0; c < division.pieces(b); ++c) {
    if (!layout.is_plain(division.piece_at(b, c))) ++odd;
  }
  scratch_.resize(odd * m.chunk);
  std::array<const std::byte*, code::kMostPieces> in;
  std::byte* room = scratch_.data();
  for (std::size_t c = 0; c < division.pieces(b); ++c) {
    const std::size_t piece = division.piece_at(b, c);
    if (layout.is_plain(piece)) {
      in[c] = m.bytes.payload.data() + layout.in_payload(piece);
      continue;
    }
    layout.load(m.bytes, piece, room);
    in[c] = room;
    room += m.chunk;
  }
  const std::size_t end = division.symbol_at(b, first + count - 1) + 1;
  if (m.pieces.size() < end) m.pieces.resize(end);
  if (m.symbols.size() < end - m.count) m.symbols.resize(end - m.count);
  std::array<std::byte*, code::kMostRows> out;
  for (std::size_t row = 0; row < count; ++row) {
    Bytes& symbol = m.symbols[division.symbol_at(b, first + row) - m.count];
    symbol.resize(m.chunk);
    out[row] = symbol.data();
  }
  code::encode({in.data(), division.pieces(b)}, m.chunk, first, {out.data(), count});
  bytes_ += count * m.chunk;
  m.blocks[b].rows = static_cast<std::uint8_t>(first + count);
  for (std::size_t row = 0; row < count; ++row) {
    queue_again(now, path, m.id, static_cast<std::uint16_t>(division.symbol_at(b, first + row)));
  }
}

}  // namespace interneuron::flow
