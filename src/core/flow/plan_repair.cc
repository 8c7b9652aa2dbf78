// Where a fragment that is lost is sent again: which path brings another copy soonest, whether that
// is in time, and whether one copy is enough.
#include <algorithm>
#include <tuple>

#include "core/flow/planners.h"

namespace interneuron::flow {
namespace {

// A path whose timeouts are longer than so many one-way delays has late fragments where others have
// lost ones: with delays distributed exponentially the timeout is more than twice as long, on a
// steady link it is about three one-way delays.
constexpr int kSteadyTimeout = 4;

// A copy of a fragment that is or could be under way.
struct Copy {
  LinkId link{};
  const SendPath* path = nullptr;
  TimePoint arrival{};
};

// Whether a second copy of what is lost on a path may be worth its place. Not where the path is
// loaded, since it would cost others; nor where delays vary so much that a timeout is twice a round
// trip, since what seems lost there is mostly late.
bool may_double(const PathView& view) {
  return !view.loaded && view.probe_timeout <= kSteadyTimeout * view.one_way;
}

// The soonest copy of a fragment that is queued or in flight; nothing when there is no such copy.
// Copies on suspected paths count where none is sound, or where they are asked for.
std::optional<Copy> soonest_copy(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                                 std::uint16_t index, bool with_suspected) {
  if (m.pieces[index].under_way == 0) return std::nullopt;
  std::optional<Copy> best;
  const bool sound =
      !with_suspected && m.kind == wire::MessageKind::kPlain && traffic.any_is_sound();
  for (const auto& [link, path] : traffic.paths) {
    // Nobody knows when a path that is suspected brings anything.
    if (!path.view.up || (path.view.suspect && sound)) continue;
    const Job* job = path.jobs.find(m.id);
    if (job != nullptr && (job->awaits(index) || job->again.contains(index))) {
      const std::size_t ahead = job->awaits(index) ? index - job->next + 1U : job->again.size();
      const TimePoint arrival = now + path.view.air_time(ahead * m.chunk) + path.view.one_way;
      if (!best || arrival < best->arrival) best = {link, &path, arrival};
    }
    if (const auto sent_at = path.sent.sent_at({m.id, index})) {
      const TimePoint arrival = *sent_at + path.view.one_way;
      if (!best || arrival < best->arrival) best = {link, &path, arrival};
    }
  }
  return best;
}

// The path, other than `except`, that would bring a lost fragment of this message soonest. One that
// is suspected carries it where no other is in time: suspicion is often wrong, and where the others
// are too slow nothing is better than that.
std::optional<Copy> best_repair(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                                const SendPath* except) {
  std::optional<Copy> best;
  // Whether it is too late, over a path that is suspected though others are not, over a backup; and
  // when it is there. Less is better.
  using Rank = std::tuple<bool, bool, bool, TimePoint>;
  Rank best_rank;
  const bool sound = m.kind == wire::MessageKind::kPlain && traffic.any_is_sound();
  for (const auto& [link, path] : traffic.paths) {
    if (!path.view.up || &path == except || !m.repairs.contains(link)) continue;
    if (!path.can_carry(m.chunk)) continue;
    const Duration queue = path.view.air_time(path.before_again(m) + m.chunk);
    const TimePoint arrival = std::max(now, path.free_at) + queue + path.view.one_way;
    const bool suspected = path.view.suspect && sound;
    const bool in_time = arrival <= m.deadline;
    if (suspected && !in_time) continue;
    const Rank rank{!in_time, suspected, path.view.backup, arrival};
    if (best && best_rank <= rank) continue;
    best = {link, &path, arrival};
    best_rank = rank;
  }
  return best;
}

}  // namespace

// It goes over the path that brings it soonest, unless that is too late or another copy is sooner
// still. Where the loss of the soonest copy would be known too late for another one, two are under
// way, on different paths: with 1 % of loss one message of a hundred fragments in a hundred needs
// the second. Not after silence, in which a whole message seems lost and is mostly late.
RepairOrder plan_repair(const Traffic& traffic, TimePoint now, const OutgoingMessage& m,
                        std::uint16_t index, Evidence evidence) {
  if (!traffic.repairs) return {};
  const auto best = best_repair(traffic, now, m, nullptr);
  const bool in_time = best && best->arrival <= m.deadline;
  const auto other = soonest_copy(traffic, now, m, index, best && best->path->view.suspect);
  const bool other_is_sooner = other && (!best || other->arrival <= best->arrival);
  // A second copy is not worth a backup.
  const auto is_dearer = [](const Copy& a, const Copy& b) {
    return a.path->view.backup && !b.path->view.backup;
  };
  const auto is_last = [&m, evidence](const Copy& copy) {
    return evidence == Evidence::kReport && may_double(copy.path->view) &&
           copy.arrival + copy.path->view.probe_timeout > m.deadline;
  };
  if (other_is_sooner &&
      (!in_time || other->path == best->path || !is_last(*other) || is_dearer(*best, *other))) {
    return {};
  }
  if (!in_time) return {std::nullopt, std::nullopt, true};
  RepairOrder order{best->link, std::nullopt};
  if ((other && other->arrival <= m.deadline) || !is_last(*best)) return order;
  const auto second = best_repair(traffic, now, m, best->path);
  if (second && second->arrival <= m.deadline && may_double(second->path->view) &&
      !is_dearer(*second, *best)) {
    order.second = second->link;
  }
  return order;
}

}  // namespace interneuron::flow
