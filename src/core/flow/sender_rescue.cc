// What is done for a message that is likely to be late: the last moment at which another path, or a
// smaller variant over it, still helps.
//
// Whether a path brings a message in time is not known before it does. So the question is asked as
// late as possible: when what is missing of the message has to leave over another path to be there
// in time, and once more when a smaller variant has to. By then most messages are acknowledged, and
// nothing is sent. While a path is silent, nobody knows for how much longer: a silence that has
// lasted for t goes on for longer than t' more with the probability t / (t + t'), which is what
// heavy-tailed silences do.
#include <algorithm>
#include <array>
#include <vector>

#include "core/base/earliest.h"
#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// Feedback is late when it comes so long after a round trip: what it may be delayed by (5 ms,
// src/core/peers/feedback_due.h) and as much for the turns of both event loops.
constexpr Duration kLate = std::chrono::milliseconds(10);
// What rescues a message has to be there so much before the deadline. No measurement behind this
// value: it only has to be more than a turn of an event loop.
constexpr Duration kMargin = std::chrono::milliseconds(2);
// A message is rescued when it is late with more than this probability, times the share of its
// bytes that this costs.
constexpr double kWorthwhile = 0.1;
// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);

double seconds(Duration d) { return std::chrono::duration<double>(d).count(); }

}  // namespace

// How likely it is that a path brings what it has of this message after `target`.
double Sender::chance_late(TimePoint now, const Path& path, const Message& m,
                           TimePoint target) const {
  const Job* job = path.jobs.find(m.id);
  const DataRate rate = path.view.rate.value_or(kBlindRate);
  const std::size_t queued =
      job == nullptr ? 0 : path.jobs.bytes_before(turn_of(path, m.deadline, m.importance));
  const auto air = [rate](std::size_t bytes) {
    return std::min<Duration>(rate.transmit_time(bytes), kNever);
  };
  const auto awaited = path.sent.awaited_since(m.id);
  const Duration silence =
      awaited ? now - (*awaited + 2 * path.view.one_way + kLate) : Duration{-1};
  if (silence <= Duration::zero()) {
    // What is behind already will not be sooner at the end.
    const Duration behind = std::max<Duration>(silence + kLate, Duration::zero());
    const TimePoint left = job == nullptr ? path.sent.newest_left() : now + air(queued);
    return left + path.view.one_way + (awaited ? behind : Duration::zero()) > target ? 1 : 0;
  }
  const Duration spare = target - now - air(queued + path.sent.bytes_in_flight()) -
                         (job == nullptr ? Duration::zero() : path.view.one_way);
  if (spare <= Duration::zero()) return 1;
  return seconds(silence) / seconds(silence + spare);
}

// The path of these that may begin latest to bring so many bytes by `target`, and until when it
// may.
std::optional<Sender::Copy> Sender::last_chance(const Message& m, const PathSet& over,
                                                const Path* except, std::size_t bytes,
                                                TimePoint target) {
  std::optional<Copy> best;
  for (auto& [link, path] : paths_) {
    const bool may_carry = over.contains(link) && &path != except && path.view.up &&
                           !path.view.suspect && path.max_datagram >= m.chunk + kPieceOverheadBytes;
    if (!may_carry) continue;
    const DataRate rate = path.view.rate.value_or(kBlindRate);
    const Duration takes =
        std::min<Duration>(rate.transmit_time(path.jobs.bytes() + bytes), kNever) +
        path.view.one_way + kMargin;
    const TimePoint latest = target - takes;
    if (!best || latest > best->arrival) best = {&path, latest};
  }
  return best;
}

std::size_t Sender::missing_bytes(const Message& m) {
  return std::size_t{m.unacknowledged} * (m.chunk + kPieceOverheadBytes + kIpUdpBytes);
}

// Sets when the message is looked at next: at the first moment that will be too late for something,
// be it for its aim or for its deadline.
void Sender::plan_rescue(TimePoint now, Message& m) {
  std::optional<TimePoint> look;
  const auto consider = [&](const Message& what, const PathSet& over) {
    if (over.empty()) return;
    // Over whichever path: the one that is soonest may be the one that fails.
    for (const auto& [link, path] : paths_) {
      if (!over.contains(link)) continue;
      const PathSet one = PathSet::of(std::array{link});
      for (const TimePoint target : {m.aim, m.deadline}) {
        const auto chance = last_chance(m, one, nullptr, missing_bytes(what), target);
        if (chance && chance->arrival > now) look = earliest(look, std::optional(chance->arrival));
      }
    }
  };
  consider(m, m.rescue);
  if (const Message* other = m.alternative ? messages_.find(*m.alternative) : nullptr) {
    consider(*other, other->rescue);
  }
  messages_.look_at(m.id, look);
}

// Whether a message is rescued for this instant, at the last moment for that.
bool Sender::rescued_for(TimePoint now, Message& m, TimePoint target) {
  Path* laggard = nullptr;
  double late = 0;
  for (auto& [link, path] : paths_) {
    if (!m.taken.contains(link)) continue;
    const double chance = path.view.up ? chance_late(now, path, m, target) : 1;
    if (laggard == nullptr || chance > late) laggard = &path;
    late = std::max(late, chance);
  }
  const double all = static_cast<double>(m.bytes.size());
  const auto worth = [late, all](std::size_t bytes) {
    return late > kWorthwhile * std::min(1.0, static_cast<double>(bytes) / all);
  };
  // A look comes at the last moment, give or take what the rate has changed since it was planned.
  const auto is_now = [now](const std::optional<Copy>& chance) {
    return chance && chance->arrival + kMargin >= now && chance->arrival <= now + kMargin;
  };
  const auto own = last_chance(m, m.rescue, laggard, missing_bytes(m), target);
  if (is_now(own) && worth(missing_bytes(m))) {
    rescue(now, *own->path, m);
    return true;
  }
  Message* other = m.alternative ? messages_.find(*m.alternative) : nullptr;
  if (other == nullptr) return false;
  const auto smaller = last_chance(*other, other->rescue, laggard, missing_bytes(*other), target);
  if (!is_now(smaller) || !worth(missing_bytes(*other))) return false;
  m.alternative.reset();
  begin_rescue(now, *smaller->path, *other);
  return true;
}

void Sender::look_after(TimePoint now, Message& m) {
  if (rescued_for(now, m, m.aim)) return;
  if (m.aim < m.deadline && rescued_for(now, m, m.deadline)) return;
  plan_rescue(now + kMargin, m);
}

// The pieces that are not acknowledged and that this path neither has in flight nor is to send.
std::vector<std::uint16_t> Sender::missing_on(Path& path, const Message& m) {
  std::vector<bool> has(m.count);
  for (const auto& [piece, arrived, was_open] : path.sent.in_flight()) {
    if (piece.message == m.id && piece.index < m.count) has[piece.index] = true;
  }
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

// What is missing of a message goes over this path as well.
void Sender::rescue(TimePoint now, Path& path, Message& m) {
  m.rescue = {};
  Message* other = m.alternative ? messages_.find(*m.alternative) : nullptr;
  if (other != nullptr) other->rescue = {};
  for (const std::uint16_t index : missing_on(path, m)) queue_again(now, path, m.id, index);
}

void Sender::begin_rescue(TimePoint now, Path& path, Message& m) {
  path.use.queued(now);
  begin_alternative(path, m);
}

}  // namespace interneuron::flow
