#include "lab/transports/outlay.h"

#include <net/ethernet.h>
#include <sys/resource.h>

#include <fstream>
#include <sstream>
#include <string>

#include "app/process/failure.h"

namespace interneuron::transports {
namespace {

// The NICs of the network namespace of this process (man 5 proc).
constexpr const char* kCounters = "/proc/self/net/dev";
// A line is "NIC: " and 16 counters, eight of what was received and eight of what was sent, each
// time bytes and packets first.
constexpr int kCountersReceived = 8;

Duration time_of(const timeval& t) {
  return std::chrono::seconds(t.tv_sec) + std::chrono::microseconds(t.tv_usec);
}

std::uint64_t ip_bytes_sent() {
  std::ifstream file(kCounters);
  std::string line;
  // Two lines of headings.
  std::getline(file, line);
  std::getline(file, line);
  if (!file)
    throw process::Failure(process::kFailed,
                           std::string(kCounters) + ": the counters cannot be read");
  std::uint64_t sum = 0;
  while (std::getline(file, line)) {
    const std::size_t colon = line.find(':');
    const std::size_t name = line.find_first_not_of(' ');
    if (colon == std::string::npos || line.substr(name, colon - name) == "lo") continue;
    std::istringstream counters(line.substr(colon + 1));
    std::uint64_t value = 0;
    for (int i = 0; i < kCountersReceived; ++i) counters >> value;
    std::uint64_t bytes = 0;
    std::uint64_t packets = 0;
    if (!(counters >> bytes >> packets)) continue;
    sum += bytes - packets * ETHER_HDR_LEN;
  }
  return sum;
}

}  // namespace

// This cannot fail: the argument is valid.
Duration processor_time() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return time_of(usage.ru_utime) + time_of(usage.ru_stime);
}

Outlay::Outlay() : cpu_(processor_time()), sent_(ip_bytes_sent()) {}

std::uint64_t Outlay::wire_bytes() const { return ip_bytes_sent() - sent_; }

}  // namespace interneuron::transports
