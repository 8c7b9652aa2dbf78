// How much may be in flight on a subflow, and how fast it leaves: the rule that tells one TCP from
// another. The subflow tells it of what arrives and what is lost, and asks for the window. Sizes
// are payload bytes. Implementations are pure and belong to one subflow.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"
#include "lab/foreign/segment.h"

namespace interneuron::foreign {

// RFC 6928.
inline constexpr std::size_t kInitialWindow = std::size_t{10} * kMss;

// What an acknowledgement has shown.
struct Delivery {
  Duration now{};
  // That had not been known to have arrived.
  std::size_t bytes = 0;
  // The most that was in flight within the last round trip.
  std::size_t peak_in_flight = 0;
  Duration smoothed_rtt{};
  // Of the newest segment; nothing when it was sent more than once.
  std::optional<Duration> rtt{};
  // The rate at which segments arrived while the newest one was on its way; 0: not known.
  DataRate rate{};
  // The application had nothing to send then, so that the rate says nothing of the path.
  bool application_limited = false;
  // The newest segment was sent after the first one of the round trip before had arrived: a round
  // trip has passed.
  bool round_began = false;
  // What is in flight after it.
  std::size_t in_flight = 0;
};

class CongestionControl {
 public:
  virtual ~CongestionControl() = default;
  virtual void delivered(const Delivery& delivery) = 0;
  // Something was lost or marked; at most once for each window of data.
  virtual void congested(Duration now) = 0;
  // Nothing was heard for the retransmission timeout.
  virtual void timed_out(Duration now) = 0;
  // The subflow sends again after it had nothing in flight for `idle`.
  virtual void restarted(Duration idle, Duration retransmission_timeout) = 0;
  // The most that may be in flight.
  virtual std::size_t window() const = 0;
  // Segments leave no faster than this; nothing: as the window allows.
  virtual std::optional<DataRate> pacing_rate() const { return std::nullopt; }
};

}  // namespace interneuron::foreign
