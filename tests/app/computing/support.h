// Units of three levels and their jobs, for the tests of RoadsideUnit.
#pragma once

#include <vector>

#include "app/computing/roadside_unit.h"

namespace interneuron::computing {

using namespace std::chrono_literals;

inline constexpr Duration kDeadline = 130ms;

inline std::vector<LevelProfile> three_levels() {
  return {{8ms, 10ms, {}}, {19ms, 24ms, {}}, {44ms, 48ms, {}}};
}

using Unit = RoadsideUnit<int>;

inline TimePoint at(Duration t) { return TimePoint{t}; }

inline Unit::Job job(std::uint32_t round, TimePoint delivered, Duration deadline = kDeadline) {
  Unit::Job out;
  out.message.round.round = RoundId{round};
  out.message.deadline = deadline;
  out.delivered = delivered;
  out.top = 2;
  out.input = static_cast<int>(round);
  return out;
}

inline Unit::Job job_of(std::uint32_t peer, std::uint32_t round, TimePoint delivered,
                        Duration deadline = kDeadline) {
  Unit::Job out = job(round, delivered, deadline);
  out.message.from = PeerId{peer};
  return out;
}

// The jobs that have ended without a result since the last call.
inline std::vector<Unanswered> unanswered(Unit& unit) {
  std::vector<Unanswered> out;
  while (const auto one = unit.poll_unanswered()) out.push_back(*one);
  return out;
}

}  // namespace interneuron::computing
