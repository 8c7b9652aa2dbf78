// Repair symbols of messages: when they are worth their bytes, how many, and over which path.
//
// What is lost early in a message is reported in time to be sent again, which costs least. What
// leaves so late that its loss would be known too late to send it once more is in its last round
// (PieceState::last), and symbols alone can make that good. They leave when all of the message has
// left, because then it is known what of it was lost before; over another path than the message if
// one is in time, because what loses pieces loses symbols beside them.
#include <algorithm>

#include "core/code/erasure_code.h"
#include "core/code/redundancy.h"
#include "core/flow/planners.h"

namespace interneuron::flow {
namespace {

// Symbols have to be there so much before they are needed. No measurement behind this value: it
// only has to be more than a batch of packets takes.
constexpr Duration kSymbolMargin = std::chrono::milliseconds(2);

// The path that brings so many bytes of symbols in time if they are queued at `when`, of those that
// the message itself does not take if there is one.
std::optional<LinkId> symbol_path(const Traffic& traffic, TimePoint when, const OutgoingMessage& m,
                                  std::size_t bytes, TimePoint target) {
  std::optional<LinkId> best;
  TimePoint soonest{};
  bool best_is_own = false;
  for (const auto& [link, path] : traffic.paths) {
    const bool may_carry = m.symbol_paths.contains(link) && path.view.up &&
                           path.has_room_beside(m.id) && path.can_carry(m.chunk);
    if (!may_carry) continue;
    const bool is_own = m.taken.contains(link);
    const std::size_t ahead = is_own ? 0 : path.jobs.bytes();
    const TimePoint arrival = when + path.view.air_time(ahead + bytes) + path.view.one_way;
    // Another path has to be in time surely: one of its own is known to deliver just now.
    const Duration doubt = is_own ? Duration::zero() : kSureDeviations * path.view.jitter;
    if (arrival + doubt + kSymbolMargin > target || (path.view.suspect && !is_own)) continue;
    if (!best || std::pair(is_own, arrival) < std::pair(best_is_own, soonest)) {
      best = link;
      soonest = arrival;
      best_is_own = is_own;
    }
  }
  return best;
}

}  // namespace

bool symbols_can_wait(const Traffic& traffic, TimePoint now, const OutgoingMessage& m) {
  TimePoint all_left = now;
  std::size_t own = 0;
  for (const auto& [link, path] : traffic.paths) {
    const Job* job = path.jobs.find(m.id);
    if (job == nullptr) continue;
    own = std::max(own, job->ip_bytes());
    const DataRate pace = path.view.pace.value_or(kBlindPace);
    all_left =
        std::max(all_left, now + std::min<Duration>(pace.transmit_time(path.jobs.bytes()), kNever));
  }
  return symbol_path(traffic, all_left, m, own / kMostPart, m.aim).has_value();
}

std::optional<SymbolOrder> plan_symbols(const Traffic& traffic, TimePoint now,
                                        const OutgoingMessage& m, std::size_t b, Protect what) {
  const OutgoingMessage::Block& block = m.blocks[b];
  const std::size_t pieces = m.division().pieces(b);
  // What is known to be lost is made good beyond that.
  const std::size_t lost = pieces + block.rows - block.acknowledged - block.under_way;
  const std::size_t most = std::min<std::size_t>(pieces / kMostPart + 1 + lost, code::kMostRows);
  const std::size_t at_risk = what == Protect::kAll ? block.under_way : block.last;
  if (at_risk == 0 || block.rows >= most || m.spare(b) < 0) return std::nullopt;
  code::Losses losses;
  for (const auto& [link, path] : traffic.paths) {
    const code::Losses& there = path.view.losses;
    const bool carries = m.taken.contains(link) || path.jobs.find(m.id) != nullptr;
    if (carries && there.share > losses.share) losses = there;
  }
  const double price = kPriceOfBytes / static_cast<double>(m.count) / value_of(m.importance);
  const std::size_t count = code::symbols_for(at_risk, static_cast<std::size_t>(m.spare(b)), losses,
                                              price, most - block.rows);
  if (count == 0) return std::nullopt;
  auto path = symbol_path(traffic, now, m, count * m.chunk, m.aim);
  if (!path) path = symbol_path(traffic, now, m, count * m.chunk, m.deadline);
  const bool has_index = m.division().symbol_at(b, block.rows + count - 1) <= UINT16_MAX;
  if (!path || !has_index) return std::nullopt;
  return SymbolOrder{*path, count};
}

}  // namespace interneuron::flow
