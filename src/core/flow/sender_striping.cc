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
// Nothing is slower: a rate of zero would divide by it.
constexpr DataRate kLeastRate{1000};

}  // namespace

// The pieces that each of these paths carries, in their order; 0 for those that would only delay
// it.
Sender::Shares Sender::shares(TimePoint now, const Message& m,
                              const std::vector<LinkId>& paths) const {
  std::array<Way, kMaxLinks> ways;
  std::array<std::size_t, kMaxLinks> places{};
  std::size_t used = 0;
  const bool sound = std::ranges::any_of(paths, [this](LinkId link) {
    const PathView& view = paths_.at(link).view;
    return view.up && !view.suspect;
  });
  for (std::size_t i = 0; i < std::min(paths.size(), kMaxLinks); ++i) {
    const Path& path = paths_.at(paths[i]);
    if (!path.view.up || (path.view.suspect && sound)) continue;
    const DataRate rate = std::max(path.view.rate.value_or(kBlindRate), kLeastRate);
    const std::size_t ahead = path.jobs.bytes_before(turn_of(path, m.deadline, m.importance));
    // What is in flight beyond an empty path waits in a queue.
    const Duration queue = std::max<Duration>(
        rate.transmit_time(path.sent.bytes_in_flight()) - 2 * path.view.least_one_way,
        Duration::zero());
    ways[used] = {rate,
                  std::min<Duration>(rate.transmit_time(ahead) + queue, kNever) + path.view.one_way,
                  path.view.jitter};
    places[used++] = i;
  }
  Shares out{};
  if (used == 0) {
    out.front() = m.count;
    return out;
  }
  const std::size_t piece = m.chunk + kPieceOverheadBytes + kIpUdpBytes;
  const Division division = divide(std::span(ways).first(used), m.count * piece, m.deadline - now);
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

}  // namespace interneuron::flow
