// Delivery rate samples from acknowledgements (draft-cheng-iccrg-delivery-rate-estimation-02): of
// the packets between two acknowledged ones, min(rate sent, rate acknowledged). Pure;
// thread-compatible; constant memory.
//
// The sender keeps a DeliveryStamp per packet in flight: sent() when it leaves, acknowledged() for
// each packet that a feedback newly covers, then sample() once for that feedback.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::link {

struct DeliveryStamp {
  TimePoint sent_at{};
  TimePoint first_sent_at{};
  TimePoint delivered_at{};
  std::uint64_t delivered = 0;  // bytes delivered when this packet left
  std::uint32_t bytes = 0;
  bool app_limited = false;
};

class DeliveryRate {
 public:
  // A packet of `bytes` (at IP level) leaves; `idle`: nothing else of this path is in flight.
  // `more_waits`: others wait behind it, so that pacing and not the application sets the rate.
  DeliveryStamp sent(TimePoint now, std::uint32_t bytes, bool idle, bool more_waits);
  void acknowledged(TimePoint now, const DeliveryStamp& stamp);

  struct Sample {
    DataRate rate;
    bool app_limited = false;  // bounds the link from below, no more
  };
  // Of the packets acknowledged since the last call; nothing when they cover less than `min_rtt`,
  // where a burst of acknowledgements would look like a rate.
  std::optional<Sample> sample(Duration min_rtt);

 private:
  std::uint64_t delivered_ = 0;
  TimePoint delivered_at_{};
  TimePoint first_sent_at_{};
  std::optional<DeliveryStamp> newest_;  // of those acknowledged since the last sample
};

}  // namespace interneuron::link
