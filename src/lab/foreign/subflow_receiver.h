// The receiving end of one subflow: what has arrived, and what is acknowledged when. Every second
// segment in order at once, every one out of order at once, the rest after kAckDelay (RFC 5681,
// section 4.2); the blocks of what is out of order newest first (RFC 2018). Memory: one entry per
// gap. Pure; thread-compatible; no errors.
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "lab/foreign/segment.h"

namespace interneuron::foreign {

// The least of Linux (TCP_DELACK_MIN); RFC 1122, section 4.2.3.2 allows up to 500 ms.
inline constexpr Duration kAckDelay = std::chrono::milliseconds(40);

class SubflowReceiver {
 public:
  // A segment has arrived; `marked` by a queue on its way.
  void segment(Duration now, const DataSegment& segment, bool marked);
  // The instant of next_timeout() has come.
  void handle_timeout(Duration now);
  // The acknowledgement that leaves now, if any.
  std::optional<AckSegment> poll();
  std::optional<Duration> next_timeout() const { return timer_; }

 private:
  void add(const Range& range);
  void advance();

  std::uint64_t next_ = 0;
  // Beyond next_: newest first, none touches another.
  std::vector<Range> gaps_beyond_;
  bool due_ = false;
  // Segments in order that no acknowledgement has covered.
  int held_ = 0;
  Duration echo_{};
  std::optional<Duration> timer_{};
  bool congestion_seen_ = false;
};

}  // namespace interneuron::foreign
