// What a roadside unit notes of the messages that arrive, and what its process costs meanwhile.
#pragma once

#include <optional>
#include <vector>

#include "lab/transports/message_head.h"
#include "lab/transports/order.h"

namespace interneuron::cli {

// Memory: some 24 bytes for each message of the run. Thread-compatible; no errors.
class Reception {
 public:
  // A message is there whole.
  void arrived(const MessageHead& head, std::uint32_t variant, TimePoint now);
  // Processor time of this process, user and system, over time, from the first arrival to the last.
  double cpu() const;
  const std::vector<Arrival>& arrivals() const { return arrivals_; }

 private:
  std::vector<Arrival> arrivals_;
  Duration cpu_at_first_{};
  Duration cpu_at_last_{};
};

}  // namespace interneuron::cli
