// What becomes of a fragment that is lost: which path brings another copy soonest, whether that is
// in time, and whether one copy is enough.
#include <algorithm>
#include <tuple>

#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// Stands for a time beyond any that is planned with, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);
// A path whose timeouts are longer than so many one-way delays has late fragments where others have
// lost ones: with delays distributed exponentially the timeout is more than twice as long, on a
// steady link it is about three one-way delays.
constexpr int kSteadyTimeout = 4;

// Whether a second copy of what is lost on a path may be worth its place. Not where the path is
// loaded, since it would cost others; nor where delays vary so much that a timeout is twice a round
// trip, since what seems lost there is mostly late.
bool may_double(const PathView& view) {
  return !view.loaded && view.probe_timeout <= kSteadyTimeout * view.one_way;
}

}  // namespace

// The soonest copy of a fragment that is queued or in flight; nothing when there is no such copy.
// Copies on suspected paths count where none is sound, or where they are asked for.
std::optional<Sender::Copy> Sender::soonest_copy(TimePoint now, MessageId id, std::uint16_t index,
                                                 bool with_suspected) {
  const Message& m = *messages_.find(id);
  if (m.pieces[index].under_way == 0) return std::nullopt;
  std::optional<Copy> best;
  const bool sound = !with_suspected && m.kind == wire::MessageKind::kPlain && any_is_sound();
  for (auto& [link, path] : paths_) {
    // Nobody knows when a path that is suspected brings anything.
    if (!path.view.up || (path.view.suspect && sound)) continue;
    const Job* job = path.jobs.find(id);
    if (job != nullptr && (job->awaits(index) || job->again.contains(index))) {
      const std::size_t ahead = job->awaits(index) ? index - job->next + 1U : job->again.size();
      const DataRate rate = path.view.rate.value_or(kBlindRate);
      const Duration air = std::min<Duration>(rate.transmit_time(ahead * m.chunk), kNever);
      const TimePoint arrival = now + air + path.view.one_way;
      if (!best || arrival < best->arrival) best = {&path, arrival};
    }
    if (const auto sent_at = path.sent.sent_at({id, index})) {
      const TimePoint arrival = *sent_at + path.view.one_way;
      if (!best || arrival < best->arrival) best = {&path, arrival};
    }
  }
  return best;
}

// Queues a fragment again on the path that brings it soonest, unless that is too late or another
// copy is sooner still. Where the loss of the soonest copy would be known too late for another one,
// two are under way, on different paths: with 1 % of loss one message of a hundred fragments in a
// hundred needs the second. Not after silence, in which a whole message seems lost and is mostly
// late.
bool Sender::repair(TimePoint now, MessageId id, std::uint16_t index, Evidence evidence) {
  if (!options_.repair) return false;
  const Message& m = *messages_.find(id);
  const auto best = best_repair(now, m, nullptr);
  const bool in_time = best && best->arrival <= m.deadline;
  const auto other = soonest_copy(now, id, index, best && best->path->view.suspect);
  const bool other_is_sooner = other && (!best || other->arrival <= best->arrival);
  // A second copy is not worth a backup.
  const auto is_dearer = [](const Path& a, const Path& b) {
    return a.view.backup && !b.view.backup;
  };
  const auto is_last = [&m, evidence](const Copy& copy) {
    return evidence == Evidence::kReport && may_double(copy.path->view) &&
           copy.arrival + copy.path->view.probe_timeout > m.deadline;
  };
  if (other_is_sooner && (!in_time || other->path == best->path || !is_last(*other) ||
                          is_dearer(*best->path, *other->path))) {
    return false;
  }
  if (!in_time) {
    ++cancelled_;
    return false;
  }
  queue_again(now, *best->path, id, index);
  if ((other && other->arrival <= m.deadline) || !is_last(*best)) return true;
  const auto second = best_repair(now, m, best->path);
  if (second && second->arrival <= m.deadline && may_double(second->path->view) &&
      !is_dearer(*second->path, *best->path)) {
    queue_again(now, *second->path, id, index);
  }
  return true;
}

// Bytes that leave a path before what is sent again of this message. What is due later waits for
// it, and so does what has not left yet of the message itself.
std::size_t Sender::before_again(const Path& path, const Message& m) {
  const std::size_t before = path.jobs.bytes_before(turn_of(path, m.deadline, m.importance));
  const Job* job = path.jobs.find(m.id);
  const std::size_t own = job == nullptr ? 0 : job->bytes() - job->again.size() * job->chunk;
  return before - std::min(before, own);
}

void Sender::queue_again(TimePoint now, Path& path, MessageId id, std::uint16_t index) {
  Message& m = *messages_.find(id);
  m.copy_added(index);
  if (is_last(now, path, m)) m.set_last(index, true);
  path.use.queued(now);
  Job* job = path.jobs.find(id);
  if (job == nullptr) {
    job = &path.jobs.add(id, turn_of(path, m.deadline, m.importance), m.count, m.count, m.chunk);
  }
  path.jobs.push_again(*job, index);
}

// The path, other than `except`, that would bring a lost fragment of this message soonest. One that
// is suspected carries it where no other is in time: suspicion is often wrong, and where the others
// are too slow nothing is better than that.
std::optional<Sender::Copy> Sender::best_repair(TimePoint now, const Message& m,
                                                const Path* except) {
  std::optional<Copy> best;
  // Whether it is too late, over a path that is suspected though others are not, over a backup; and
  // when it is there. Less is better.
  using Rank = std::tuple<bool, bool, bool, TimePoint>;
  Rank best_rank;
  const bool sound = m.kind == wire::MessageKind::kPlain && any_is_sound();
  for (auto& [link, path] : paths_) {
    const bool may_carry = &path != except && m.repairs.contains(link) &&
                           path.max_datagram >= m.chunk + kPieceOverheadBytes;
    if (!path.view.up || !may_carry) continue;
    const DataRate rate = path.view.rate.value_or(kBlindRate);
    const std::size_t ahead = before_again(path, m);
    const Duration queue = std::min<Duration>(rate.transmit_time(ahead + m.chunk), kNever);
    const TimePoint arrival = std::max(now, path.free_at) + queue + path.view.one_way;
    const bool suspected = path.view.suspect && sound;
    const bool in_time = arrival <= m.deadline;
    if (suspected && !in_time) continue;
    const Rank rank{!in_time, suspected, path.view.backup, arrival};
    if (best && best_rank <= rank) continue;
    best = {&path, arrival};
    best_rank = rank;
  }
  return best;
}

}  // namespace interneuron::flow
