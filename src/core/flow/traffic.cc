#include "core/flow/traffic.h"

#include <algorithm>
#include <cmath>

namespace interneuron::flow {
namespace {

// The longest batch: what waits for it in a queue is there for no longer, and a wake-up costs as
// much as a dozen packets (`SO_TXTIME` in docs/decisions.md, and what follows it).
constexpr Duration kLongestBatch = std::chrono::milliseconds(2);
// Nor does a batch take more than this part of the time that a message has. No measurement behind
// this value: it only has to be little.
constexpr int kBatchPart = 20;
// The pace is above the rate of the path by this part of it (RateEstimator::kHeadroom), so that
// what has left is ahead of what the path has carried by this part of the time, and by kBurst. No
// batch is longer, or the path would fall idle.
constexpr int kHeadroomPart = 4;
// A longer batch saves no call: one segmented send carries so many bytes (docs/constants.md,
// "Datagrams and sockets").
constexpr std::size_t kBatchBytes = 64 * 1024;
// A path may catch up with this much time at its rate after idling or a late timer: it makes up for
// the timer and fills no queue (docs/constants.md, "Rate of a link"). What a batch has waited for
// is no lateness, nor is as much more.
constexpr Duration kBurst = std::chrono::milliseconds(1);
// The longest time that a packet may occupy the path at the pace, so that a wrong pace of almost
// nothing does not block the path for ever.
constexpr Duration kLongestAir = std::chrono::seconds(1);
// Where others wait, a message yields to its alternative this long before it would be given up: by
// then the time of several of them may be as short. No measurement behind this value: with a third
// of it some of their alternatives are late, with twice as much messages yield that would have
// arrived (`interneuron bench load rate size`).
constexpr Duration kYieldsBefore = std::chrono::milliseconds(15);
// An idle path may have become faster unseen: it still gets a message whose least time is up to so
// many halves of the time that is left.
constexpr int kIdleOptimism = 3;
// What cannot arrive even if paths carry so much more than is believed is given up. Rates of radio
// double within a second, and only what is sent tells. No measurement behind this value.
constexpr double kMayRise = 2;
// The rate may have risen for so many seconds at the most: to a thousand times what it was.
constexpr double kMostRise = 10;
// How much sooner than its deadline a message must be there for its first fragment to be sent while
// the path is loaded, because the share of a loaded path changes while a message is under way: this
// long, or a part of what it takes to leave. No measurement behind either value.
constexpr Duration kLeastMargin = std::chrono::milliseconds(5);
constexpr int kMarginDivisor = 16;
// The longest queue that is believed. No measurement behind this value: it only has to be longer
// than what congestion control allows; more is in flight while a path is silent, which is no queue.
constexpr Duration kLongestQueue = std::chrono::milliseconds(80);
// What bulk may have in flight beyond an idle path, as time at its rate: what feedback may be late
// by (5 ms, src/core/peers/feedback_due.h) and by as much again as packets take of which one report
// tells (16 of them, at 20 Mbit/s 9.6 ms). With it what is urgent waits 11 ms longer than over
// an idle path of 20 Mbit/s (tests/lab/sim/plain_messages_test.cc).
constexpr Duration kBulkQueue = std::chrono::milliseconds(15);
// Nothing is slower: a rate of zero would divide by it.
constexpr DataRate kLeastRate{1000};
// How long after its time an arrival is reported at the latest (src/core/peers/feedback_due.h), so
// that a loss is known so much later than a round trip.
constexpr Duration kReportDelay = std::chrono::milliseconds(5);
// What is sent again has to be there so much before it is needed. No measurement behind this value:
// it only has to be more than a batch of packets takes.
constexpr Duration kAgainMargin = std::chrono::milliseconds(2);
// A path that is only to repair has its say in the size of pieces where it carries at least 3/4 of
// what the paths of the plan carry: a message takes a third more packets then, and 2 % more bytes
// on the wire. No measurement behind this value.
constexpr std::size_t kWorthwhileParts = 3;
constexpr std::size_t kOfParts = 4;

}  // namespace

// Where there is room for everything, the earliest deadline first is best for everything. Where
// there is not, it would serve what is due soonest and let the most important wait for it.
JobQueue::Turn SendPath::turn_of(TimePoint deadline, std::int16_t importance) const {
  const bool counts = view.loaded || importance == kBulkImportance;
  const int rank = JobQueue::kLastRank - (counts ? importance : kUsualImportance);
  return {static_cast<std::uint16_t>(rank), deadline};
}

std::size_t SendPath::bulk_window() const {
  const double seconds = to_seconds(2 * view.least_one_way + kBulkQueue);
  const double bits = seconds * static_cast<double>(view.planned_rate().bits_per_second);
  return static_cast<std::size_t>(bits / 8);
}

// What is due later waits for it, and so does what has not left yet of the message itself.
std::size_t SendPath::before_again(const OutgoingMessage& m) const {
  const std::size_t before = jobs.bytes_before(turn_of(m));
  const Job* job = jobs.find(m.id);
  const std::size_t own = job == nullptr ? 0 : job->bytes() - job->again.size() * job->chunk;
  return before - std::min(before, own);
}

Duration SendPath::queue_at(DataRate rate) const {
  return std::max<Duration>(rate.transmit_time(sent.bytes_in_flight()) - told_after(),
                            Duration::zero());
}

Way SendPath::way_of(const OutgoingMessage& m) const {
  const DataRate believed = std::max(view.planned_rate(), kLeastRate);
  const DataRate rate = believed.scaled(1 / (1 + std::max(0.0, law.mean())));
  const std::size_t ahead = jobs.bytes_before(turn_of(m));
  const Duration wait = rate.transmit_time(ahead) + queue_at(rate);
  return {rate, std::min<Duration>(wait, kNever) + view.one_way, view.jitter, law.deviation()};
}

Duration SendPath::time_to_bring(std::size_t ip_bytes) const {
  const DataRate rate = std::max(view.planned_rate(), kLeastRate);
  return std::min<Duration>(rate.transmit_time(ip_bytes), kNever) + queue_at(rate) + view.one_way;
}

Duration SendPath::least_time(std::size_t ip_bytes, bool begun) const {
  if (!view.soon) return Duration::zero();
  const Duration air = std::min<Duration>(view.soon->transmit_time(ip_bytes), kNever);
  // What is in flight beyond an empty path waits before it.
  const Duration queue =
      std::clamp<Duration>(view.soon->transmit_time(sent.bytes_in_flight()) - told_after(),
                           Duration::zero(), kLongestQueue);
  const Duration margin =
      begun ? Duration::zero() : std::max<Duration>(kLeastMargin, air / kMarginDivisor);
  return queue + air + view.least_one_way + margin;
}

// Where messages are refused nothing is measured, so that no refusal lasts: the rate may have risen
// by kMayRise in each second since.
Duration SendPath::possible_time(TimePoint now, std::size_t ip_bytes) const {
  if (view.crowded) return least_time(ip_bytes, false);
  if (!view.best) return view.least_one_way;
  const double seconds = std::clamp(to_seconds(now - view.best_at), 0.0, kMostRise);
  const double rise = std::pow(kMayRise, 1 + seconds);
  const Duration air = view.best->scaled(rise).transmit_time(ip_bytes);
  return std::min<Duration>(air, kNever) + view.least_one_way;
}

void SendPath::occupy(TimePoint now, std::size_t ip_bytes) {
  const Duration air = view.pace.value_or(kBlindPace).transmit_time(ip_bytes);
  const bool was_idle = free_at < now - kLongestBatch - kBurst;
  if (was_idle || left_at == TimePoint::min()) busy_since = now;
  left_at = now;
  const TimePoint least = was_idle || view.short_queue ? now - kBurst : free_at;
  free_at = std::max(free_at, least) + std::min<Duration>(air, kLongestAir);
}

bool Traffic::any_is_sound() const {
  return std::ranges::any_of(
      paths, [](const auto& entry) { return entry.second.view.up && !entry.second.view.suspect; });
}

std::size_t Traffic::piece_bytes(const PathList& plan, const PathSet& repairing) const {
  std::size_t planned = SIZE_MAX;
  for (const LinkId path : plan) planned = std::min(planned, paths.at(path).max_datagram);
  std::size_t datagram = planned;
  for (const auto& [link, path] : paths) {
    const bool may_repair = repairs && path.view.up && repairing.contains(link);
    const bool worthwhile = path.max_datagram >= planned / kOfParts * kWorthwhileParts;
    if (may_repair && worthwhile) datagram = std::min(datagram, path.max_datagram);
  }
  return datagram - kPieceOverheadBytes;
}

namespace {

// Whether nothing is queued or in flight on a path but what it has of this message.
bool is_alone(const SendPath& path, const Job& job, const OutgoingMessage& m) {
  const std::size_t pieces = m.count + m.symbols.size();
  const std::size_t gone = pieces - std::min(pieces, job.pieces());
  return path.jobs.size() == 1 && path.sent.bytes_in_flight() <= gone * m.ip_bytes_of_piece();
}

}  // namespace

bool Traffic::can_arrive(TimePoint now, const SendPath& path, const Job& job,
                         const OutgoingMessage& m) const {
  // What comes too late over a path with room takes nothing from anybody, and tells the guard at
  // the other end how late it was.
  if (!path.view.loaded && !m.alternative) return true;
  if (!m.divided.empty() && !m.alternative) return together_can_arrive(now, m);
  const bool begun = job.next > 0 || m.is_alternative;
  const Duration least = path.least_time(job.ip_bytes(), begun);
  // What still has an alternative makes way for it while that can arrive, and those behind it.
  const bool makes_way = m.alternative && !begun && path.jobs.size() > 1;
  const Duration early = makes_way ? kYieldsBefore : Duration::zero();
  // A path on which nothing is under way may have become faster since; only what it is given tells.
  const bool is_idle = path.sent.bytes_in_flight() == 0 && path.jobs.size() == 1;
  // A slow one that nothing else waits for would be given nothing by which more could be believed.
  if (path.view.slow && !m.alternative && is_alone(path, job, m)) return true;
  const bool tries = is_idle && !m.alternative && !m.symbol_paths.empty();
  const Duration hoped = tries ? least / kIdleOptimism * 2 : least;
  return now + hoped + early <= m.deadline + m.doubt;
}

// Whether the paths of a divided message may bring together what has not left yet.
bool Traffic::together_can_arrive(TimePoint now, const OutgoingMessage& m) const {
  double left = 0;
  double can = 0;
  for (const auto& [link, path] : paths) {
    if (const Job* job = path.jobs.find(m.id)) left += static_cast<double>(job->ip_bytes());
    if (!m.divided.contains(link) || !path.view.up) continue;
    if (!path.view.loaded || !path.view.soon) return true;
    const Duration time = m.deadline + m.doubt - now - path.least_time(0, true);
    const double seconds = std::max(0.0, to_seconds(time));
    can += seconds * static_cast<double>(path.view.soon->bits_per_second) / 8;
  }
  return left <= can * kMayRise;
}

Duration Traffic::batch(const SendPath& path) const {
  const Job* job = path.jobs.first();
  if (job == nullptr || job->pieces() == 0) return kQuantum;
  const OutgoingMessage& m = *messages.find(job->message);
  // The stages of a round are judged by the millisecond.
  if (m.kind == wire::MessageKind::kRound) return kQuantum;
  const DataRate pace = path.view.pace.value_or(kBlindPace);
  const Duration time = std::chrono::microseconds(m.lifetime_us);
  // What has left keeps the path busy for so long at least.
  const Duration ahead = kBurst + (path.left_at - path.busy_since) / kHeadroomPart;
  const Duration longest = path.view.short_queue
                               ? kQuantum
                               : std::min({Duration(kLongestBatch), time / kBatchPart, ahead,
                                           pace.transmit_time(kBatchBytes)});
  // The last packet of a message leaves as soon as it may, with all that wait before it. Where
  // other messages follow it, they leave together.
  const Duration rest =
      static_cast<std::int64_t>(job->pieces() - 1) *
      std::min<Duration>(pace.transmit_time(ip_bytes_of_piece(job->chunk)), kNever);
  const Duration least = path.jobs.size() > 1 ? kQuantum : Duration::zero();
  return std::min(std::max(kQuantum, longest), std::max(rest, least));
}

// A loss is known a round trip and a report later; the copy then takes one way more, and its own
// time on the air, which is long on a slow path. Where too few packets follow to tell of it, it may
// take until the timeout; to be in time for the deadline is enough then.
bool Traffic::is_last(TimePoint now, const SendPath& path, const OutgoingMessage& m) const {
  if (m.symbol_paths.empty()) return false;
  Duration back = kNever;
  for (const auto& [link, other] : paths) {
    if (!other.view.up || !m.repairs.contains(link)) continue;
    const Duration air = other.view.air_time(m.ip_bytes_of_piece());
    back = std::min<Duration>(back, other.view.one_way + air);
  }
  const TimePoint told = now + 2 * path.view.one_way + kReportDelay + path.view.report_spacing;
  if (told + back + kAgainMargin > m.aim) return true;
  // Behind a message of a round there is more to do: what is there by the deadline alone helps
  // none.
  const bool is_tail = m.kind == wire::MessageKind::kPlain &&
                       path.jobs.bytes() < SentPackets::kReorderPackets * m.chunk;
  return is_tail && now + path.view.probe_timeout + back + kAgainMargin > m.deadline;
}

}  // namespace interneuron::flow
