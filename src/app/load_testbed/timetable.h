// When which vehicle hands over a message, for programs that play all vehicles in one loop. Pure.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "lab/load/scenario.h"

namespace interneuron::cli {

struct Due {
  // Since messages begin.
  Duration at{};
  std::size_t vehicle = 0;
};

// In the order of time.
inline std::vector<Due> timetable(const load::Scenario& scenario) {
  const std::vector<Duration> first = load::first_messages(scenario);
  std::vector<Due> out;
  for (std::size_t v = 0; v < first.size(); ++v) {
    for (Duration at = first[v]; at < scenario.length; at += scenario.period) {
      out.push_back({at, v});
    }
  }
  std::ranges::sort(out, {}, &Due::at);
  return out;
}

}  // namespace interneuron::cli
