// What is done for a message that is likely to be late: the last moment at which another path, or a
// smaller variant over it, still helps.
//
// Whether a path brings a message in time is not known before it does. So the question is asked as
// late as possible: when what is missing of the message has to leave over another path to be there
// in time, and once more when a smaller variant has to. By then most messages are acknowledged, and
// nothing is sent. While a path is silent, nobody knows for how much longer: a silence that has
// lasted for t goes on for longer than t' more with the probability t / (t + t'), which is what
// heavy-tailed silences do.
//
// And which messages leave a path that may have fallen silent for another one.
#include <algorithm>
#include <array>

#include "core/base/earliest.h"
#include "core/flow/planners.h"

namespace interneuron::flow {
namespace {

// Feedback is late when it comes so long after a round trip: what it may be delayed by (5 ms,
// src/core/peers/feedback_due.h) and as much for the turns of both event loops.
constexpr Duration kLate = std::chrono::milliseconds(10);
// A message is rescued when it is late with more than this probability, times the share of its
// bytes that this costs.
constexpr double kWorthwhile = 0.1;

// How likely it is that a path brings what it has of this message after `target`.
double chance_late(TimePoint now, const SendPath& path, const OutgoingMessage& m,
                   TimePoint target) {
  const Job* job = path.jobs.find(m.id);
  const std::size_t queued = job == nullptr ? 0 : path.jobs.bytes_before(path.turn_of(m));
  const auto awaited = path.sent.awaited_since(m.id);
  const Duration silence =
      awaited ? now - (*awaited + 2 * path.view.one_way + kLate + path.view.report_spacing)
              : Duration{-1};
  if (silence <= Duration::zero()) {
    // What is behind already will not be sooner at the end.
    const Duration behind = std::max<Duration>(silence + kLate, Duration::zero());
    const TimePoint left =
        job == nullptr ? path.sent.newest_left() : now + path.view.air_time(queued);
    return left + path.view.one_way + (awaited ? behind : Duration::zero()) > target ? 1 : 0;
  }
  const Duration spare = target - now - path.view.air_time(queued + path.sent.bytes_in_flight()) -
                         (job == nullptr ? Duration::zero() : path.view.one_way);
  if (spare <= Duration::zero()) return 1;
  return to_seconds(silence) / to_seconds(silence + spare);
}

// How a message is rescued for this instant, at the last moment for that.
std::optional<RescueOrder> rescue_for(const Traffic& traffic, TimePoint now,
                                      const OutgoingMessage& m, TimePoint target) {
  std::optional<LinkId> laggard;
  double late = 0;
  for (const auto& [link, path] : traffic.paths) {
    if (!m.taken.contains(link)) continue;
    const double chance = path.view.up ? chance_late(now, path, m, target) : 1;
    if (!laggard || chance > late) laggard = link;
    late = std::max(late, chance);
  }
  const double all = static_cast<double>(m.bytes.size());
  const auto is_worth = [late, all](const OutgoingMessage& what) {
    const auto bytes = static_cast<double>(what.missing_ip_bytes());
    return late > kWorthwhile * std::min(1.0, bytes / all);
  };
  const auto departure = [&](const OutgoingMessage& what) {
    return last_departure(traffic, what, what.rescue, laggard, what.missing_ip_bytes(), target);
  };
  // A look comes at the last moment, give or take what the rate has changed since it was planned.
  const auto is_now = [now](const std::optional<LastDeparture>& last) {
    return last && last->at + kRescueMargin >= now && last->at <= now + kRescueMargin;
  };
  const auto own = departure(m);
  if (is_now(own) && is_worth(m)) return RescueOrder{own->path, false};
  const OutgoingMessage* other = m.alternative ? traffic.messages.find(*m.alternative) : nullptr;
  if (other == nullptr) return std::nullopt;
  const auto smaller = departure(*other);
  if (!is_now(smaller) || !is_worth(*other)) return std::nullopt;
  return RescueOrder{smaller->path, true};
}

}  // namespace

std::optional<LastDeparture> last_departure(const Traffic& traffic, const OutgoingMessage& m,
                                            const PathSet& over, std::optional<LinkId> except,
                                            std::size_t ip_bytes, TimePoint target) {
  std::optional<LastDeparture> best;
  for (const auto& [link, path] : traffic.paths) {
    const bool may_carry = over.contains(link) && link != except && path.view.up &&
                           !path.view.suspect && path.can_carry(m.chunk);
    if (!may_carry) continue;
    const Duration takes =
        path.view.air_time(path.jobs.bytes() + ip_bytes) + path.view.one_way + kRescueMargin;
    const TimePoint latest = target - takes;
    if (!best || latest > best->at) best = {link, latest};
  }
  return best;
}

// In silence a whole message seems lost. Where a smaller variant stands by and all that is missing
// cannot be in time elsewhere, a part of it would only be in that variant's way.
bool gives_way(const Traffic& traffic, TimePoint now, const OutgoingMessage& m, Evidence evidence) {
  if (evidence == Evidence::kReport || !m.alternative) return false;
  const OutgoingMessage* other = traffic.messages.find(*m.alternative);
  if (other == nullptr || other->rescue.empty()) return false;
  const auto last =
      last_departure(traffic, m, m.repairs, std::nullopt, m.missing_ip_bytes(), m.deadline);
  return !last || last->at < now;
}

std::optional<RescueOrder> plan_rescue(const Traffic& traffic, TimePoint now,
                                       const OutgoingMessage& m) {
  const auto order = rescue_for(traffic, now, m, m.aim);
  if (order || m.aim >= m.deadline) return order;
  return rescue_for(traffic, now, m, m.deadline);
}

// At the first moment that will be too late for something, be it for its aim or for its deadline.
std::optional<TimePoint> next_look(const Traffic& traffic, TimePoint from,
                                   const OutgoingMessage& m) {
  std::optional<TimePoint> look;
  const auto consider = [&](const OutgoingMessage& what) {
    if (what.rescue.empty()) return;
    // Over whichever path: the one that is soonest may be the one that fails.
    for (const auto& [link, path] : traffic.paths) {
      if (!what.rescue.contains(link)) continue;
      const PathSet one = PathSet::of(std::array{link});
      for (const TimePoint target : {m.aim, m.deadline}) {
        const auto last =
            last_departure(traffic, m, one, std::nullopt, what.missing_ip_bytes(), target);
        if (last && last->at > from) look = earliest(look, last->at);
      }
    }
  };
  consider(m);
  if (const auto* other = m.alternative ? traffic.messages.find(*m.alternative) : nullptr) {
    consider(*other);
  }
  return look;
}

std::vector<std::uint16_t> missing_on(const SendPath& path, const OutgoingMessage& m) {
  std::vector<bool> has(m.count);
  path.sent.for_each_in_flight([&](const SentPackets::Piece& piece) {
    if (piece.message == m.id && piece.index < m.count) has[piece.index] = true;
  });
  if (const Job* job = path.jobs.find(m.id)) {
    job->for_each([&](std::uint16_t index) {
      if (index < m.count) has[index] = true;
    });
  }
  std::vector<std::uint16_t> out;
  for (std::uint16_t i = 0; i < m.count; ++i) {
    if (!m.pieces[i].acknowledged && !has[i]) out.push_back(i);
  }
  return out;
}

std::map<MessageId, std::size_t> owed_by(const Traffic& traffic, const SendPath& path) {
  std::map<MessageId, std::size_t> owed;
  path.sent.for_each_in_flight([&](const SentPackets::Piece& piece) {
    const OutgoingMessage* m = traffic.messages.find(piece.message);
    if (m != nullptr && !m->pieces[piece.index].acknowledged) ++owed[piece.message];
  });
  for (const MessageId id : path.jobs.messages()) owed[id] += path.jobs.find(id)->pieces();
  return owed;
}

// A message moves where another path brings all that this one still owes, in time. A part of it
// would be of no use, and in the way of what the other path carries itself. Rounds have a guard
// that counts on the links of their plans: what moves falsely costs them more than a stall does.
MoveOrder plan_move(const Traffic& traffic, TimePoint now, LinkId from, const OutgoingMessage& m,
                    std::size_t owed_pieces) {
  if (!m.rescue.empty()) {
    // It stays where it is, too: suspicion is often wrong, and this one has a way out for it.
    const auto last = last_departure(traffic, m, m.rescue, from, m.missing_ip_bytes(), m.deadline);
    return {last && last->at >= now ? std::optional(last->path) : std::nullopt, false};
  }
  if (m.kind != wire::MessageKind::kPlain) return {};
  const std::size_t bytes = owed_pieces * m.chunk;
  const bool fits = std::ranges::any_of(traffic.paths, [&](const auto& other) {
    const SendPath& path = other.second;
    return path.view.up && !path.view.suspect && m.repairs.contains(other.first) &&
           path.can_carry(m.chunk) &&
           now + path.view.air_time(path.jobs.bytes() + bytes) + path.view.one_way <= m.deadline;
  });
  return {std::nullopt, fits};
}

}  // namespace interneuron::flow
