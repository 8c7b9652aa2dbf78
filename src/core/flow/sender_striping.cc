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
// A message that is less likely to be in time goes over all paths that are idle. No measurement
// behind this value.
constexpr double kDoubtful = 0.5;
// Nothing is slower: a rate of zero would divide by it.
constexpr DataRate kLeastRate{1000};

}  // namespace

std::size_t Sender::ip_bytes_of_piece(const Message& m) {
  return m.chunk + kPieceOverheadBytes + kIpUdpBytes;
}

// A path as it would carry a message that is queued on it now.
Way Sender::way_of(const Path& path, const Message& m) {
  const DataRate believed = std::max(path.view.rate.value_or(kBlindRate), kLeastRate);
  const DataRate rate = believed.scaled(1 / (1 + std::max(0.0, path.law.mean())));
  const std::size_t ahead = path.jobs.bytes_before(turn_of(path, m.deadline, m.importance));
  // What is in flight beyond an empty path waits in a queue.
  const Duration queue = std::max<Duration>(
      rate.transmit_time(path.sent.bytes_in_flight()) - 2 * path.view.least_one_way,
      Duration::zero());
  return {rate, std::min<Duration>(rate.transmit_time(ahead) + queue, kNever) + path.view.one_way,
          path.view.jitter, path.law.deviation()};
}

// The pieces that each of these paths carries, in their order; 0 for those that would only delay
// it. Returns whether each carries a copy of all of them.
bool Sender::shares(TimePoint now, const Message& m, const std::vector<LinkId>& paths,
                    Shares& out) const {
  std::array<Way, kMaxLinks> ways;
  std::array<std::size_t, kMaxLinks> places{};
  std::size_t used = 0;
  out = {};
  const bool sound = std::ranges::any_of(paths, [this](LinkId link) {
    const PathView& view = paths_.at(link).view;
    return view.up && !view.suspect;
  });
  for (std::size_t i = 0; i < std::min(paths.size(), kMaxLinks); ++i) {
    const Path& path = paths_.at(paths[i]);
    if (!path.view.up || (path.view.suspect && sound)) continue;
    ways[used] = way_of(path, m);
    places[used++] = i;
  }
  if (used == 0) {
    out.front() = m.count;
    return false;
  }
  const std::size_t piece = ip_bytes_of_piece(m);
  const Division division = divide(std::span(ways).first(used), m.count * piece, m.aim - now);
  // What would be late anyhow costs nothing by going over a path that has nothing else to do, and
  // tells what it carries by now.
  const bool copies = division.copies || division.on_time < kDoubtful;
  std::size_t left = m.count;
  std::size_t largest = 0;
  for (std::size_t w = 0; w < used; ++w) {
    if (copies) {
      const Path& path = paths_.at(paths[places[w]]);
      const bool is_idle = path.sent.bytes_in_flight() == 0 && path.jobs.empty();
      out[places[w]] = division.bytes[w] > 0 || is_idle ? m.count : std::uint16_t{0};
      continue;
    }
    const std::size_t pieces = std::min(left, division.bytes[w] / piece);
    out[places[w]] = static_cast<std::uint16_t>(pieces);
    left -= pieces;
    if (division.bytes[w] > division.bytes[largest]) largest = w;
  }
  if (!copies) {
    out[places[largest]] = static_cast<std::uint16_t>(out[places[largest]] + left);
  }
  return copies;
}

// Queues all of a message on each of these paths, or shares of it.
void Sender::enqueue(TimePoint now, Message& m, const std::vector<LinkId>& paths, bool divided) {
  Shares parts;
  parts.fill(m.count);
  bool copies = true;
  if (divided) copies = shares(now, m, paths, parts);
  std::uint8_t used = 0;
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < std::min(paths.size(), kMaxLinks); ++i) {
    if (parts[i] == 0) continue;
    const std::uint32_t from = copies ? 0 : next;
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
    used += 1;
  }
  if (divided) m.paths = copies ? used : std::uint8_t{1};
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
