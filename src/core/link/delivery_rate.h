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

// What the sender keeps of a packet in flight.
struct DeliveryStamp {
  TimePoint sent_at{};
  // When the packet left that was acknowledged last before this one left, and when its
  // acknowledgement came.
  TimePoint first_sent_at{};
  TimePoint delivered_at{};
  // Bytes that had been acknowledged in all when this packet left.
  std::uint64_t delivered = 0;
  std::uint32_t bytes = 0;
  // The application had nothing more to send, so this packet shows no limit of the link.
  bool app_limited = false;
};

// Takes the samples of one path. SentPackets owns it and feeds it. A peer that acknowledges what
// has not arrived, or late, shifts the samples; they only raise the estimate of a path to itself.
class DeliveryRate {
 public:
  // A packet of `bytes` (at IP level) leaves; `idle`: nothing else of this path is in flight.
  // `more_waits`: others wait behind it, so that pacing and not the application sets the rate.
  DeliveryStamp sent(TimePoint now, std::uint32_t bytes, bool idle, bool more_waits);
  void acknowledged(TimePoint now, const DeliveryStamp& stamp);

  // Bytes that were acknowledged in all.
  std::uint64_t delivered() const { return delivered_; }

  struct Sample {
    DataRate rate;
    // The application limited the rate: the link delivers at least this much.
    bool app_limited = false;
  };
  // The rate of the packets acknowledged since the last call. Nothing when they cover less than
  // `min_rtt`, because a burst of acknowledgements would then look like a rate.
  std::optional<Sample> sample(Duration min_rtt);

 private:
  std::uint64_t delivered_ = 0;
  TimePoint delivered_at_{};
  TimePoint first_sent_at_{};
  // The stamp of the newest packet acknowledged since the last sample.
  std::optional<DeliveryStamp> newest_;
};

}  // namespace interneuron::link
