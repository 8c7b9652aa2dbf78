// Window symbols over small messages: which messages they cover, when they leave, and how many.
//
// A symbol of its own is 12 to 100 % of a message of one to eight pieces. Where further messages
// follow soon enough, one symbol covers several: it waits until just before the time at which it
// would be too late for the first of them, or until the last message before that has left. It is
// weighed like symbols of one message (plan_coding.cc): what cannot be asked for again is covered
// as long as that saves more than the bytes cost.
#include <algorithm>

#include "core/code/redundancy.h"
#include "core/flow/planners.h"

namespace interneuron::flow {
namespace {

// How long a piece may be for a symbol that covers the most messages to fit beside it.
constexpr std::size_t kRoom = wire::kPacketOverhead + wire::kSourceHeaderBytes +
                              wire::window_header_bytes(wire::kMostWindowMessages);

using Covered = Few<const OutgoingMessage*, wire::kMostWindowMessages>;

std::size_t longest_piece(const OutgoingMessage& m) {
  return std::min<std::size_t>(m.chunk, m.bytes.size());
}

// Until when a symbol for this message may leave over this path to be there by `target`; nothing
// where the path does not carry it.
std::optional<TimePoint> latest_over(LinkId link, const SendPath& path, const OutgoingMessage& m,
                                     TimePoint target, bool is_own) {
  const std::size_t bytes = longest_piece(m) + kRoom;
  const bool may_carry = m.symbol_paths.contains(link) && path.view.up &&
                         path.has_room_beside(m.id) && path.max_datagram >= bytes &&
                         (is_own || !path.view.suspect);
  if (!may_carry) return std::nullopt;
  const std::size_t ahead = is_own ? 0 : path.jobs.bytes();
  // Another path has to be in time surely: one of its own is known to deliver just now.
  const Duration doubt = (is_own ? 1 : kSureDeviations) * path.view.jitter;
  return target - path.view.one_way - doubt - kQuantum - path.view.air_time(ahead + bytes);
}

// The path over which a symbol for these messages leaves now: one that is in time for all of them,
// and that they do not take if there is one.
std::optional<LinkId> window_path(const Traffic& traffic, TimePoint now, const Covered& messages) {
  std::optional<LinkId> best;
  std::pair<bool, TimePoint> rank;
  for (const auto& [link, path] : traffic.paths) {
    const LinkId id = link;
    const bool is_own = std::ranges::any_of(
        messages, [id](const OutgoingMessage* m) { return m->taken.contains(id); });
    TimePoint latest = TimePoint::max();
    for (const OutgoingMessage* m : messages) {
      const auto chance = latest_over(link, path, *m, m->deadline, is_own);
      latest = std::min(latest, chance.value_or(TimePoint::min()));
    }
    // Who may leave latest is there soonest.
    const std::pair mine{!is_own, latest};
    if (latest < now || (best && mine <= rank)) continue;
    best = link;
    rank = mine;
  }
  return best;
}

// The pieces of a message that are not acknowledged, as a window's header tells them.
std::uint8_t missing_of(const OutgoingMessage& m) {
  std::uint8_t missing = 0;
  for (std::uint16_t i = 0; i < m.count; ++i) {
    if (!m.pieces[i].acknowledged) missing = static_cast<std::uint8_t>(missing | 1U << i);
  }
  return missing;
}

}  // namespace

// A small message has pieces that are about equally long, so that symbols are no longer than they
// must be; and such that a symbol fits into a packet, where messages follow each other closely: one
// piece more for the few sizes that fill all packets is less than a symbol of their own.
std::size_t even_chunk(const Traffic& traffic, std::size_t bytes, std::size_t chunk,
                       const Protection& protection) {
  const WindowFlow& window = traffic.window;
  if (!window.is_understood() || protection.symbols.empty()) return chunk;
  const std::size_t most = chunk + kPieceOverheadBytes - kRoom;
  std::size_t count = (bytes + chunk - 1) / chunk;
  if (count < wire::kMostWindowPieces && window.next()) count = (bytes + most - 1) / most;
  return count > 1 && count <= wire::kMostWindowPieces ? (bytes + count - 1) / count : chunk;
}

bool is_for_windows(const OutgoingMessage& m) {
  return !m.symbol_paths.empty() && m.count <= wire::kMostWindowPieces;
}

std::optional<TimePoint> window_latest(const Traffic& traffic, const OutgoingMessage& m,
                                       TimePoint target) {
  std::optional<TimePoint> latest;
  for (const auto& [link, path] : traffic.paths) {
    const auto chance = latest_over(link, path, m, target, m.taken.contains(link));
    if (chance && (!latest || *chance > *latest)) latest = chance;
  }
  return latest;
}

std::optional<WindowOrder> plan_window(const Traffic& traffic, TimePoint now,
                                       WindowFlow::Pending pending) {
  std::ranges::sort(pending, [](MessageId a, MessageId b) {
    return static_cast<std::int32_t>(a.value - b.value) < 0;
  });
  Covered covered;
  WindowOrder order;
  std::size_t bytes = 0;
  code::Losses losses;
  std::int16_t importance = 0;
  for (const MessageId id : pending) {
    const OutgoingMessage* m = traffic.messages.find(id);
    if (m == nullptr) continue;
    const auto latest = window_latest(traffic, *m, m->deadline);
    if (!latest || *latest < now) continue;
    const std::uint8_t missing = missing_of(*m);
    const bool follows = covered.empty() || id.value - covered.back()->id.value <= wire::kMostAhead;
    if (missing == 0 || !follows) continue;
    order.header.messages.push_back({id, missing});
    covered.push_back(m);
    bytes += m->bytes.size();
    order.longest = std::max(order.longest, longest_piece(*m));
    importance = std::max(importance, m->importance);
    for (const auto& [link, path] : traffic.paths) {
      const code::Losses& there = path.view.losses;
      if (m->taken.contains(link) && there.share > losses.share) losses = there;
    }
  }
  if (covered.empty()) return std::nullopt;
  const std::size_t at_risk = order.header.sources();
  const double part =
      static_cast<double>(order.longest * covered.size()) / static_cast<double>(bytes);
  order.count = code::symbols_for(at_risk, 0, losses, kPriceOfBytes * part / value_of(importance),
                                  at_risk / kMostPart + 1);
  const auto over = order.count == 0 ? std::nullopt : window_path(traffic, now, covered);
  if (!over) return std::nullopt;
  order.path = *over;
  order.until = TimePoint::min();
  for (const OutgoingMessage* m : covered) {
    order.until = std::max(order.until, m->deadline - traffic.paths.at(*over).view.one_way);
  }
  return order;
}

}  // namespace interneuron::flow
