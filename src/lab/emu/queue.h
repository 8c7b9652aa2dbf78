// How a queue in front of a bottleneck is managed, and how long it stands: the marks of ECN, the
// control law of CoDel, and the time that packets would have to wait. Pure; thread-compatible; no
// errors.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::emu {

// What the two ECN bits of an IP header say (RFC 3168, section 5; RFC 9331, section 2): whether the
// sender understands marks, and whether a queue on the way has set one. Plain values. Pure.
enum class Ecn : std::uint8_t {
  // The sender does not understand marks: a queue can only drop the packet.
  kNotEct = 0,
  // The sender understands marks and asks for those of L4S, many and small.
  kEct1 = 1,
  // The sender understands marks and answers one as it would answer a loss.
  kEct0 = 2,
  // A queue has marked the packet: congestion experienced.
  kCe = 3,
};

// Whether a queue may mark the packet instead of dropping it.
constexpr bool is_ect(Ecn ecn) { return ecn != Ecn::kNotEct; }

struct CoDelParams {
  // How long a packet may wait for good; RFC 8289, section 4.3.
  Duration target = std::chrono::milliseconds(5);
  // Longer than the round trip of most connections; RFC 8289, section 4.2.
  Duration interval = std::chrono::milliseconds(100);
};

// The control law of CoDel (RFC 8289): says which packets a queue has to drop, or to mark, so that
// no queue stands. It looks at the time that each packet has waited. Once every packet of a whole
// interval has waited longer than the target it signals one, and then further ones at intervals
// that shrink with the square root of their number, until a packet has waited less.
//
// The queue asks signals() for each packet that is at its head and may leave. A packet that is to
// go is dropped and the next one at the head is asked about; where the sender understands ECN it is
// marked and sent instead. Bounds: a few numbers of state.
class CoDel {
 public:
  explicit CoDel(const CoDelParams& params = {}) : params_(params) {}

  // Whether the packet at the head, which has waited for `sojourn`, is to be dropped or marked.
  // `behind` are the bytes that wait behind it. `now` never goes back.
  bool signals(Duration now, Duration sojourn, std::size_t behind);
  // There is nothing at the head.
  void emptied() {
    drop_from_.reset();
    dropping_ = false;
  }

 private:
  bool stands(Duration now, Duration sojourn, std::size_t behind);
  Duration after(Duration t) const;

  CoDelParams params_;
  // The RFC's first_above_time: when the queue will have stood for an interval, if it stands.
  std::optional<Duration> drop_from_;
  // The RFC's dropping_, drop_next_, count_ and lastcount_.
  bool dropping_ = false;
  Duration next_{};
  std::uint32_t count_ = 0;
  std::uint32_t last_count_ = 0;
  // The packet before was signalled while dropping: next_ moves on if the queue still stands.
  bool advance_ = false;
};

// How long a packet would have had to wait in a queue, over all instants and not over packets: each
// instant weighs alike, so that a queue that stands counts even while nobody sends.
//
// The wait at an instant is the time until all that is in the queue by then has left it. It falls
// as time passes and rises when a packet enters. The queue tells of each packet that has left it.
// Resolution 0.1 ms. Memory: 8 bytes for each 0.1 ms of the longest wait. Pure; thread-compatible;
// no errors; times are since the start of the link.
class QueueTime {
 public:
  // Instants before `since` do not count.
  explicit QueueTime(Duration since = {}) : since_(since) {}

  // At each instant of [from, to) the wait was the time that was left until `gone`, which is not
  // before `to`.
  void add(Duration from, Duration to, Duration gone);
  // The queue was empty from `from` to `to`.
  void add_empty(Duration from, Duration to);

  // The wait that was not exceeded for this share of the time, 0 ≤ share ≤ 1; 0 while no time has
  // been counted. Rounded up to the resolution, but 0 where there was no queue.
  Duration quantile(double share) const;
  Duration mean() const;
  // The time that has been counted.
  Duration counted() const { return counted_; }

 private:
  Duration since_;
  Duration counted_{};
  Duration empty_{};
  // The time for which the wait was within the n-th step of the resolution.
  std::vector<std::int64_t> at_;
  // The sum of wait x time, in ns².
  double area_ = 0;
};

}  // namespace interneuron::emu
