// Made-up links for the tests of `testbed verify`.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "netns/verify/readings.h"
#include "netns/verify/schedule.h"

namespace interneuron::netns::verify {

constexpr std::uint64_t kSeed = 7;

// `length` of a link whose round trip is rtt_ms(step).
template <class RttMs>
Schedule made(Duration length, RttMs rtt_ms, double loss = 0, double mbit = 10) {
  std::vector<ScheduleSample> samples;
  for (std::int64_t step = 0; step * emu::kDelayStep < length; ++step) {
    samples.push_back({step * emu::kDelayStep, from_ms(rtt_ms(step)), loss, loss,
                       DataRate::mbit(mbit), DataRate::mbit(mbit)});
  }
  return Schedule(std::move(samples));
}

inline Schedule constant(double rtt_ms, double loss = 0, double mbit = 10) {
  return made(
      std::chrono::seconds(40), [rtt_ms](std::int64_t) { return rtt_ms; }, loss, mbit);
}

inline Datagram datagram(std::uint32_t number, Duration seen, Duration stamp) {
  return Datagram{.seen = seen, .ip_bytes = 128, .number = number, .stamp = stamp};
}

}  // namespace interneuron::netns::verify
