// Series of messages that show what symbols, shares and shadows are for: losses that leave no time
// to ask again, messages that one link does not bring in time, and links that fall silent.
//
// A vehicle with two modems sends plain messages to a roadside unit (Endpoint::send()) over
// emulated links in virtual time; the same seed gives the same run. Pure; thread-safe. Errors:
// std::invalid_argument for a policy that there is not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/profile.h"

namespace interneuron::coding {

struct Series {
  // As users write it: "losses".
  std::string_view name;
  // One line for people.
  std::string_view about;
  std::vector<emu::LinkProfile> (*links)();
  Duration deadline{};
  Duration period{};
  // Bytes of each variant of a message, the best first.
  std::vector<std::size_t> variants{};
  // What this series is for.
  std::string_view policy;
  std::size_t messages = 0;
  // How often it is run, each time with another phase of the hole to the messages.
  int phases = 1;
  // Nothing passes over the first link for so long, from 2 s after the first message on; 0: no
  // hole.
  Duration hole{};
};

// In the order in which they are shown.
std::span<const Series> all_series();

// The series of that name; nullptr: there is none.
const Series* series_of(std::string_view name);

// What is counted, over all phases.
struct Row {
  const Series* series = nullptr;
  std::string policy;
  std::size_t messages = 0;
  // Without any variant by the deadline, and on time in a smaller one; and the most of these in one
  // phase.
  std::size_t missed = 0;
  std::size_t degraded = 0;
  std::size_t most_degraded = 0;
  // IP bytes that left the vehicle by its modems while messages were sent, with repairs, symbols,
  // probes, feedback and heartbeats, over the bytes of the best variants.
  double wire_ratio = 0;
};

// `messages`: of each phase.
Row run(const Series& series, std::string_view policy, std::size_t messages, std::uint64_t seed);

}  // namespace interneuron::coding
