// Window symbols over small messages: which messages they cover, when they leave, and how many.
//
// A symbol of its own is 12 to 100 % of a message of one to eight pieces. Where further messages
// follow soon enough, one symbol covers several: it waits until just before the time at which it
// would be too late for the first of them, or until the last message before that has left. It is
// weighed like symbols of one message (sender_coding.cc): what cannot be asked for again is covered
// as long as that saves more than the bytes cost.
#include <algorithm>
#include <array>

#include "core/code/field.h"
#include "core/code/redundancy.h"
#include "core/flow/sender.h"
#include "core/wire/source.h"

namespace interneuron::flow {
namespace {

// Symbols have to be there so much before they are needed, beside what the delay varies: a batch of
// packets takes so long (kQuantum of sender.cc).
constexpr Duration kMargin = std::chrono::microseconds(500);
// By how many times what its delay varies another path must be sooner: as in sender_coding.cc.
constexpr int kDeviations = 4;
// Symbols are at most this part of what they cover, and one more: as in sender_coding.cc.
constexpr std::size_t kMostPart = 7;
// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);
// How long a piece may be for a symbol that covers the most messages to fit beside it.
constexpr std::size_t kRoom = wire::kPacketOverhead + wire::kSourceHeaderBytes +
                              wire::window_header_bytes(wire::kMostWindowMessages);

std::size_t longest_piece(const OutgoingMessage& m) {
  return std::min<std::size_t>(m.chunk, m.bytes.size());
}

bool is_small(const OutgoingMessage& m) {
  return !m.symbol_paths.empty() && m.count <= wire::kMostWindowPieces;
}

}  // namespace

// A small message has pieces that are about equally long, so that symbols are no longer than they
// must be; and such that a symbol fits into a packet, where messages follow each other closely: one
// piece more for the few sizes that fill all packets is less than a symbol of their own.
std::size_t Sender::even_chunk(std::size_t bytes, std::size_t chunk, const Helpers& helpers) const {
  if (!window_.is_understood() || helpers.symbols.empty()) return chunk;
  const std::size_t most = chunk + kPieceOverheadBytes - kRoom;
  std::size_t count = (bytes + chunk - 1) / chunk;
  if (count < wire::kMostWindowPieces && window_.next()) count = (bytes + most - 1) / most;
  return count > 1 && count <= wire::kMostWindowPieces ? (bytes + count - 1) / count : chunk;
}

// Until when a symbol of so many bytes may leave over this path to be there by `target`; nothing
// where the path does not carry it.
std::optional<TimePoint> Sender::window_chance(LinkId link, const Path& path, const Message& m,
                                               TimePoint target, bool is_own) {
  const std::size_t bytes = longest_piece(m) + kRoom;
  const bool may_carry = m.symbol_paths.contains(link) && path.view.up && has_room(path, m) &&
                         path.max_datagram >= bytes && (is_own || !path.view.suspect);
  if (!may_carry) return std::nullopt;
  const DataRate rate = path.view.rate.value_or(kBlindRate);
  const std::size_t ahead = is_own ? 0 : path.jobs.bytes();
  // Another path has to be in time surely: one of its own is known to deliver just now.
  const Duration doubt = (is_own ? 1 : kDeviations) * path.view.jitter;
  return target - path.view.one_way - doubt - kMargin -
         std::min<Duration>(rate.transmit_time(ahead + bytes), kNever);
}

// The latest that a symbol may leave, over whichever path, to help a message by `target`.
std::optional<TimePoint> Sender::window_latest(const Message& m, TimePoint target) const {
  std::optional<TimePoint> latest;
  for (const auto& [link, path] : paths_) {
    const auto chance = window_chance(link, path, m, target, m.taken.contains(link));
    if (chance && (!latest || *chance > *latest)) latest = chance;
  }
  return latest;
}

// All of a message has left. True: windows cover it, and it needs no symbols of its own.
bool Sender::join_window(TimePoint now, Message& m) {
  if (!is_small(m) || !window_.is_understood()) return false;
  window_.note_left(now);
  if (m.blocks[0].last == 0 || m.blocks[0].rows > 0) return false;
  const auto latest = window_latest(m, m.aim);
  if (!latest || *latest < now) return false;
  const auto next = window_.next();
  if (!window_.has_room(m.count)) send_window(now);
  if (window_.pending().empty() && (!next || *next > *latest)) return false;
  m.in_window = true;
  window_.add(m.id, m.count, *latest);
  const bool can_wait = next && *next <= *window_.due() && window_.has_room(m.count);
  if (!can_wait) send_window(now);
  return true;
}

// The path over which a symbol for these messages leaves now: one that is in time for all of them,
// and that they do not take if there is one.
Sender::Path* Sender::window_path(TimePoint now, std::span<Message* const> messages, LinkId& over) {
  Path* best = nullptr;
  std::pair<bool, TimePoint> rank;
  for (auto& [link, path] : paths_) {
    const LinkId id = link;
    const bool is_own =
        std::ranges::any_of(messages, [id](const Message* m) { return m->taken.contains(id); });
    TimePoint latest = TimePoint::max();
    for (const Message* m : messages) {
      const auto chance = window_chance(link, path, *m, m->deadline, is_own);
      latest = std::min(latest, chance.value_or(TimePoint::min()));
    }
    // Who may leave latest is there soonest.
    const std::pair mine{!is_own, latest};
    if (latest < now || (best != nullptr && mine <= rank)) continue;
    best = &path;
    over = link;
    rank = mine;
  }
  return best;
}

// Sends the symbols that are worth their bytes for what is pending.
void Sender::send_window(TimePoint now) {
  WindowFlow::Pending pending = window_.pending();
  window_.clear_pending();
  std::ranges::sort(pending, [](MessageId a, MessageId b) {
    return static_cast<std::int32_t>(a.value - b.value) < 0;
  });
  Few<Message*, wire::kMostWindowMessages> covered;
  wire::WindowHeader header;
  std::size_t bytes = 0;
  std::size_t longest = 0;
  code::Losses losses;
  std::uint8_t importance = 0;
  for (const MessageId id : pending) {
    Message* m = messages_.find(id);
    if (m == nullptr) continue;
    m->in_window = false;
    const auto latest = window_latest(*m, m->deadline);
    if (!latest || *latest < now) continue;
    std::uint8_t missing = 0;
    for (std::uint16_t i = 0; i < m->count; ++i) {
      if (!m->pieces[i].acknowledged) missing = static_cast<std::uint8_t>(missing | 1U << i);
    }
    const bool follows = covered.empty() || id.value - covered.back()->id.value <= wire::kMostAhead;
    if (missing == 0 || !follows) continue;
    header.messages.push_back({id, missing});
    covered.push_back(m);
    bytes += m->bytes.size();
    longest = std::max(longest, longest_piece(*m));
    importance = std::max(importance, m->importance);
    for (const auto& [link, path] : paths_) {
      const code::Losses& there = path.view.losses;
      if (m->taken.contains(link) && there.share > losses.share) losses = there;
    }
  }
  if (covered.empty()) return;
  const std::size_t at_risk = header.sources();
  const double value = (1.0 + importance) / (1.0 + kUsualImportance);
  const double part = static_cast<double>(longest * covered.size()) / static_cast<double>(bytes);
  const std::size_t count =
      code::symbols_for(at_risk, 0, losses, kPriceOfBytes * part / value, at_risk / kMostPart + 1);
  LinkId over{};
  Path* path = count == 0 ? nullptr : window_path(now, covered, over);
  if (path == nullptr) return;
  TimePoint until = TimePoint::min();
  for (Message* m : covered) {
    m->in_window = true;
    until = std::max(until, m->deadline - path->view.one_way);
  }
  for (std::size_t i = 0; i < count; ++i) add_window_symbol(over, header, longest, until);
  path->use.queued(now);
}

void Sender::add_window_symbol(LinkId over, const wire::WindowHeader& header, std::size_t longest,
                               TimePoint until) {
  WindowFlow::Symbol& symbol = window_.push();
  symbol.path = over;
  symbol.until = until;
  symbol.header = header;
  symbol.header.row = window_.next_row();
  symbol.bytes.assign(wire::kSourceHeaderBytes + longest, std::byte{0});
  symbol.header.for_each([&](std::size_t column, MessageId id, std::uint8_t index) {
    const Message& m = *messages_.find(id);
    const std::uint8_t factor = code::coefficient(symbol.header.row, column);
    std::span<std::byte> to(symbol.bytes);
    const auto add = [&to, factor](ByteView from) {
      code::add_multiple(to, from, factor);
      to = to.subspan(from.size());
    };
    add(wire::source_header(fragment_of(m, index)));
    const wire::MessageBytes::Part part = part_of(m, index);
    add(part.header);
    add(part.payload);
  });
}

// A symbol that waits for this path leaves before what the path has to send else: it has waited for
// as long as it could.
std::optional<Sender::Piece> Sender::take_window_symbol(TimePoint now, LinkId link, Path& path) {
  while (WindowFlow::Symbol* symbol = window_.front(link)) {
    symbol->waits = false;
    if (symbol->until < now) continue;
    // It counts as in flight, as a piece of a message that nobody knows.
    const SentPackets::Piece piece{MessageId{next_message_++}, 0};
    const std::size_t ip_bytes = symbol->ip_bytes();
    const std::uint64_t number = path.sent.add(now, ip_bytes, !path.jobs.empty(), piece);
    ++path.symbols;
    occupy(now, path, ip_bytes);
    if (path.jobs.empty() && !window_.waits(link)) path.use.emptied(now);
    return Piece{number, {}, {{}, ByteView(symbol->bytes)}, &symbol->header};
  }
  return std::nullopt;
}

}  // namespace interneuron::flow
