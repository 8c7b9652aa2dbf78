// When the packets that a peer has sent are reported to it. Header only.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::peers {

// Told of every packet that asks for feedback, and of every feedback that tells of all paths, by
// the Peer that owns it. Feedback that may not leave stays due: the Peer says sent() only once it
// has written one. Pure; thread-compatible; constant memory.
class FeedbackDue {
 public:
  // Feedback is due after this many packets or this long, whichever is first: at most 200 a second
  // (docs/constants.md, "Feedback and round trips").
  static constexpr std::uint32_t kPackets = 16;
  static constexpr Duration kDelay = std::chrono::milliseconds(5);
  // A gap in the numbers of packets is reported at once, but not more often than this: a burst of
  // losses needs one report. For as long kPackets wait for more of a burst, because each feedback
  // costs both sides as much as dozens of packets: 16 packets take 0.2 ms at 1 Gbit/s, and 3 ms at
  // 60 Mbit/s.
  static constexpr Duration kSpacing = std::chrono::milliseconds(1);
  // After so many packets feedback is due whatever was sent: half of what one tells of
  // (wire::kAckWindow).
  static constexpr std::uint32_t kMostPackets = 128;

  explicit FeedbackDue(TimePoint now) : sent_at_(now) {}

  // A packet has arrived; `gap` when a number before it was skipped.
  void arrived(TimePoint now, bool gap) {
    if (unreported_ == 0) first_at_ = now;
    TimePoint due = now + kDelay;
    if (++unreported_ >= kPackets) due = std::max(now, first_at_ + kSpacing);
    if (unreported_ >= kMostPackets) due = now;
    if (gap) due = std::min(due, std::max(now, sent_at_ + kSpacing));
    plan(due);
  }
  // A message is complete: a burst probably ends with it, and its sender waits for that.
  void completed(TimePoint now) {
    if (unreported_ >= kPackets) plan(now);
  }
  // Nothing of what has arrived so far is to be reported any more.
  void sent(TimePoint now) {
    const Duration apart = apart_;
    *this = FeedbackDue(now);
    apart_ = apart;
  }
  // Feedback leaves at least so far apart, whatever is to be told: what it leaves over is slow
  // (src/core/base/slow_link.h).
  void keep_apart(Duration apart) { apart_ = apart; }
  Duration apart() const { return apart_; }
  // There is something to tell that no packet has brought about.
  void has_news(TimePoint now) { plan(now + kDelay); }
  // Not everything that is to be told found room in what was sent.
  void again(TimePoint now) { plan(now); }
  bool is_due(TimePoint now) const { return at_ && *at_ <= now; }
  // Nothing while there is nothing to report.
  std::optional<TimePoint> at() const { return at_; }
  TimePoint sent_at() const { return sent_at_; }

 private:
  void plan(TimePoint due) {
    due = std::max(due, sent_at_ + apart_);
    if (!at_ || due < *at_) at_ = due;
  }

  // Packets that no feedback has reported yet, and when the first of them came.
  std::uint32_t unreported_ = 0;
  TimePoint first_at_{};
  std::optional<TimePoint> at_;
  TimePoint sent_at_;
  Duration apart_{};
};

}  // namespace interneuron::peers
