#include "app/load_testbed/reception.h"

#include <sys/resource.h>

namespace interneuron::cli {
namespace {

Duration time_of(const timeval& t) {
  return std::chrono::seconds(t.tv_sec) + std::chrono::microseconds(t.tv_usec);
}

// This cannot fail: the argument is valid.
Duration processor_time() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return time_of(usage.ru_utime) + time_of(usage.ru_stime);
}

}  // namespace

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

}  // namespace interneuron::cli
