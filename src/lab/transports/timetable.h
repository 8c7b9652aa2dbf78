// When which vehicle hands over a message, for programs that play all vehicles in one loop. Pure.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "lab/transports/order.h"

namespace interneuron::transports {

struct Due {
  // Since messages begin.
  Duration at{};
  std::size_t vehicle = 0;
};

// In the order of time.
inline std::vector<Due> timetable(const Traffic& traffic) {
  std::vector<Due> out;
  for (std::size_t v = 0; v < traffic.vehicles(); ++v) {
    for (Duration at = traffic.first[v]; at < traffic.length; at += traffic.period) {
      out.push_back({at, v});
    }
  }
  std::ranges::sort(out, {}, &Due::at);
  return out;
}

}  // namespace interneuron::transports
