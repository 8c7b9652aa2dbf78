// How paths divide a message: which of them carry how many of its pieces.
#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "core/base/water_filling.h"
#include "core/flow/sender.h"

namespace interneuron::flow {
namespace {

// Stands for a time beyond any deadline, so that sums stay in range.
constexpr Duration kNever = std::chrono::hours(1);
// What cannot arrive even if paths carry so much more than is believed is given up. Rates of radio
// double within a second, and only what is sent tells. No measurement behind this value.
constexpr double kMayRise = 2;
// A piece moves to another path only where it is there so much sooner. No measurement behind this
// value: it is a turn of an event loop.
constexpr Duration kSooner = std::chrono::milliseconds(2);
// Nothing is slower: a rate of zero would divide by it.
constexpr DataRate kLeastRate{1000};

}  // namespace

std::size_t Sender::ip_bytes_of_piece(const Message& m) {
  return m.chunk + kPieceOverheadBytes + kIpUdpBytes;
}

// How long what is in flight beyond an empty path of this rate waits in a queue.
Duration Sender::queue_of(const Path& path, DataRate rate) {
  return std::max<Duration>(
      rate.transmit_time(path.sent.bytes_in_flight()) - 2 * path.view.least_one_way,
      Duration::zero());
}

// A path as it would carry a message that is queued on it now.
Way Sender::way_of(const Path& path, const Message& m) {
  const DataRate believed = std::max(path.view.rate.value_or(kBlindRate), kLeastRate);
  const DataRate rate = believed.scaled(1 / (1 + std::max(0.0, path.law.mean())));
  const std::size_t ahead = path.jobs.bytes_before(turn_of(path, m.deadline, m.importance));
  const Duration wait = rate.transmit_time(ahead) + queue_of(path, rate);
  return {rate, std::min<Duration>(wait, kNever) + path.view.one_way, path.view.jitter,
          path.law.deviation()};
}

// The pieces that each of these paths carries, in their order; 0 for those that would only delay
// it. Those that are suspected carry some where the others are not in time: suspicion is often
// wrong, and what is too slow is too late for certain.
Sender::Shares Sender::shares(TimePoint now, const Message& m,
                              const std::vector<LinkId>& paths) const {
  std::array<Way, kMaxLinks> ways;
  std::array<std::size_t, kMaxLinks> places{};
  std::size_t used = 0;
  const auto add = [&](bool suspected) {
    for (std::size_t i = 0; i < std::min(paths.size(), kMaxLinks); ++i) {
      const Path& path = paths_.at(paths[i]);
      if (!path.view.up || path.view.suspect != suspected) continue;
      ways[used] = way_of(path, m);
      places[used++] = i;
    }
  };
  const std::size_t piece = ip_bytes_of_piece(m);
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

// Queues all of a message on each of these paths, or shares of it.
void Sender::enqueue(TimePoint now, Message& m, const std::vector<LinkId>& paths, bool divided) {
  Shares parts;
  parts.fill(m.count);
  if (divided) parts = shares(now, m, paths);
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < std::min(paths.size(), kMaxLinks); ++i) {
    if (parts[i] == 0) continue;
    const std::uint32_t from = divided ? next : 0;
    next = from + parts[i];
    Path& path = paths_.at(paths[i]);
    const Way way = way_of(path, m);
    const Duration air = way.rate.transmit_time(parts[i] * ip_bytes_of_piece(m));
    m.shares.push_back({paths[i], from, next, parts[i], now + way.delay + air, air});
    path.use.message(now, parts[i] * std::size_t{m.chunk}, m.deadline - now);
    path.jobs.add(m.id, turn_of(path, m.deadline, m.importance), from,
                  static_cast<std::uint16_t>(next), m.chunk);
    m.taken.add(paths[i]);
    if (divided) {
      for (std::uint32_t p = from; p < next; ++p) m.copy_added(p);
    }
    m.to_leave += parts[i];
  }
  if (!divided) return;
  m.paths = 1;
  m.divided = PathSet::of(paths);
}

// The path of whose next message this one, which has nothing to send, brings the last piece sooner.
std::optional<LinkId> Sender::slower_path(LinkId link, const Path& path) const {
  if (path.view.suspect) return std::nullopt;
  for (const auto& [other_link, other] : paths_) {
    const Job* job = &other == &path ? nullptr : other.jobs.first();
    if (job == nullptr || job->next >= job->count) continue;
    const Message& m = *messages_.find(job->message);
    if (!m.divided.contains(link) || path.max_datagram < m.chunk + kPieceOverheadBytes) continue;
    const Duration here = time_to_bring(path, ip_bytes_of_piece(m));
    if (other.view.up && here + kSooner > time_to_bring(other, job->ip_bytes())) continue;
    return other_link;
  }
  return std::nullopt;
}

// A path that has nothing to send takes the last piece of a divided message from a path that would
// bring it later: what was believed of their rates when it was divided may be wrong by now. Returns
// whether there was one.
bool Sender::take_over(TimePoint now, LinkId link, Path& path) {
  const auto from = slower_path(link, path);
  if (!from) return false;
  Path& other = paths_.at(*from);
  Job& job = *other.jobs.first();
  Message& m = *messages_.find(job.message);
  const std::uint16_t index = other.jobs.take_last(job);
  m.leave_out(*from, index);
  path.use.queued(now);
  path.jobs.add(m.id, turn_of(path, m.deadline, m.importance), index,
                static_cast<std::uint16_t>(index + 1), m.chunk);
  m.taken.add(link);
  return true;
}

// From now until so many bytes are there that a path sends next.
Duration Sender::time_to_bring(const Path& path, std::size_t ip_bytes) {
  const DataRate rate = std::max(path.view.rate.value_or(kBlindRate), kLeastRate);
  return std::min<Duration>(rate.transmit_time(ip_bytes), kNever) + queue_of(path, rate) +
         path.view.one_way;
}

// Whether the paths of a divided message may bring together what has not left yet.
bool Sender::together_can_arrive(TimePoint now, const Message& m) const {
  double left = 0;
  double can = 0;
  for (const auto& [link, path] : paths_) {
    if (const Job* job = path.jobs.find(m.id)) left += static_cast<double>(job->ip_bytes());
    if (!m.divided.contains(link) || !path.view.up) continue;
    if (!path.view.loaded || !path.view.soon) return true;
    const Duration time = m.deadline + m.doubt - now -
                          flow::least_time(path.view, 0, path.sent.bytes_in_flight(), true);
    const double seconds = std::max(0.0, std::chrono::duration<double>(time).count());
    can += seconds * static_cast<double>(path.view.soon->bits_per_second) / 8;
  }
  return left <= can * kMayRise;
}

// Something is known of a fragment that a path was given at first: it learns from its last one how
// far off it was.
void Sender::note_brought(TimePoint now, LinkId link, Message& m, std::size_t index) {
  for (Message::Share& share : m.shares) {
    if (share.path != link || index < share.from || index >= share.to || share.open == 0) continue;
    if (--share.open == 0) learn(now, share);
  }
}

void Sender::note_not_brought(TimePoint now, const Message& m) {
  for (const Message::Share& share : m.shares) {
    if (share.open > 0) learn(now, share);
  }
}

// What was told now was there one way earlier.
void Sender::learn(TimePoint now, const Message::Share& share) {
  const auto it = paths_.find(share.path);
  if (it == paths_.end()) return;
  it->second.law.learn(now - it->second.view.least_one_way - share.eta, share.air);
}

}  // namespace interneuron::flow
