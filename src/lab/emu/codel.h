// The control law of CoDel (RFC 8289): says which packets a queue has to drop, or to mark, so that
// no queue stands. It looks at the time that each packet has waited. Once every packet of a whole
// interval has waited longer than the target it signals one, and then further ones at intervals
// that shrink with the square root of their number, until a packet has waited less.
//
// The queue asks signals() for each packet that is at its head and may leave. A packet that is to
// go is dropped and the next one at the head is asked about; where the sender understands ECN it is
// marked and sent instead. Bounds: a few numbers of state. Pure; thread-compatible; no errors.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::emu {

struct CoDelParams {
  // How long a packet may wait for good; RFC 8289, section 4.3.
  Duration target = std::chrono::milliseconds(5);
  // Longer than the round trip of most connections; RFC 8289, section 4.2.
  Duration interval = std::chrono::milliseconds(100);
};

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

}  // namespace interneuron::emu
