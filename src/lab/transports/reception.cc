#include "lab/transports/ends.h"

#include "lab/transports/outlay.h"

namespace interneuron::transports {
void Reception::arrived(const MessageHead& head, std::uint32_t variant, TimePoint now) {
  if (arrivals_.empty()) cpu_at_first_ = processor_time();
  arrivals_.push_back({head.vehicle, head.number, variant, now});
  cpu_at_last_ = processor_time();
}

double Reception::cpu() const {
  if (arrivals_.size() < 2) return 0;
  const Duration span = arrivals_.back().at - arrivals_.front().at;
  if (span <= Duration{}) return 0;
  return static_cast<double>((cpu_at_last_ - cpu_at_first_).count()) /
         static_cast<double>(span.count());
}

}  // namespace interneuron::transports
