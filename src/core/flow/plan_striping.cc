// How paths divide a message: which of them carry how many of its pieces, and which takes a piece
// from which when it has nothing to send.
#include <algorithm>
#include <span>

#include "core/base/water_filling.h"
#include "core/flow/planners.h"

namespace interneuron::flow {
namespace {

// A piece moves to another path only where it is there so much sooner. No measurement behind this
// value: it is a turn of an event loop.
constexpr Duration kSooner = std::chrono::milliseconds(2);
// A radio may become so many times slower while it carries a message: in Rayleigh fading, by which
// scripts/generate_rates.py models rates, they are below half of their mean for 39 % of the
// time.
constexpr int kFades = 2;

// Whether a path that has nothing to send may take pieces of this message from the one that has
// them to send, which needs so long for them from an instant on. Those of a divided message are
// everybody's. Those of others go where a path stands by for them and they would be late if the one
// that carries them faded; but a round's do not, whose guard counts on the links of its plan.
bool may_take(const OutgoingMessage& m, LinkId idle, TimePoint from, Duration needed) {
  if (m.divided.contains(idle)) return true;
  return m.kind == wire::MessageKind::kPlain && m.rescue.contains(idle) &&
         from + kFades * needed > m.aim;
}

}  // namespace

// Paths that are suspected carry some pieces where the others are not in time: suspicion is often
// wrong, and what is too slow is too late for certain.
Shares plan_shares(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                   const PathList& paths) {
  std::array<Way, kMaxLinks> ways;
  std::array<std::size_t, kMaxLinks> places{};
  std::size_t used = 0;
  const auto add = [&](bool suspected) {
    for (std::size_t i = 0; i < paths.size(); ++i) {
      const SendPath& path = traffic.paths.at(paths[i]);
      if (!path.view.up || path.view.suspect != suspected) continue;
      ways[used] = path.way_of(m);
      places[used++] = i;
    }
  };
  const std::size_t piece = m.ip_bytes_of_piece();
  const auto divided = [&] {
    return divide(std::span(ways).first(used), m.count * piece, m.aim - now);
  };
  Shares out{};
  Division division;
  add(false);
  if (used > 0) division = divided();
  if (used == 0 || division.time > m.aim - now) {
    add(true);
    if (used > 0) division = divided();
  }
  if (used == 0) {
    out.front() = m.count;
    return out;
  }
  std::size_t left = m.count;
  std::size_t largest = 0;
  for (std::size_t w = 0; w < used; ++w) {
    const std::size_t pieces = std::min(left, division.bytes[w] / piece);
    out[places[w]] = static_cast<std::uint16_t>(pieces);
    left -= pieces;
    if (division.bytes[w] > division.bytes[largest]) largest = w;
  }
  out[places[largest]] = static_cast<std::uint16_t>(out[places[largest]] + left);
  return out;
}

std::optional<LinkId> slower_path(const Traffic& traffic, LinkId idle) {
  const SendPath& path = traffic.paths.at(idle);
  if (path.view.suspect) return std::nullopt;
  for (const auto& [link, other] : traffic.paths) {
    const Job* job = link == idle ? nullptr : other.jobs.first();
    if (job == nullptr || job->next >= job->count) continue;
    const OutgoingMessage& m = *traffic.messages.find(job->message);
    if (!path.can_carry(m.chunk)) continue;
    const Duration there = other.time_to_bring(job->ip_bytes());
    if (!may_take(m, idle, std::max(other.free_at, path.idle_at), there)) continue;
    const Duration here = path.time_to_bring(m.ip_bytes_of_piece());
    if (other.view.up && here + kSooner > there) continue;
    return link;
  }
  return std::nullopt;
}

}  // namespace interneuron::flow
