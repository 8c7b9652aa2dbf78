#include "core/flow/path_view.h"

#include <algorithm>

namespace interneuron::flow {
namespace {

// How much sooner than its deadline a message must be there for its first fragment to be sent while
// the path is loaded, because the share of a loaded path changes while a message is under way: this
// long, or a part of what it takes to leave. No measurement behind either value.
constexpr Duration kLeastMargin = std::chrono::milliseconds(5);
constexpr int kMarginDivisor = 16;
// The longest queue that is believed. No measurement behind this value: it only has to be longer
// than what congestion control allows; more is in flight while a path is silent, which is no queue.
constexpr Duration kLongestQueue = std::chrono::milliseconds(80);

}  // namespace

Duration least_time(const PathView& view, std::size_t bytes, std::size_t in_flight, bool begun) {
  if (!view.soon) return Duration::zero();
  const Duration air = std::min<Duration>(view.soon->transmit_time(bytes), kNever);
  // What is in flight beyond an empty path waits before it.
  const Duration queue =
      std::clamp<Duration>(view.soon->transmit_time(in_flight) - 2 * view.least_one_way,
                           Duration::zero(), kLongestQueue);
  const Duration margin =
      begun ? Duration::zero() : std::max<Duration>(kLeastMargin, air / kMarginDivisor);
  return queue + air + view.least_one_way + margin;
}

}  // namespace interneuron::flow
