// Measured round-trip times at a fixed step. The file:
//
//   # Source: where it was measured          line 1
//   # step_s = 1                             line 2, seconds between samples, 0.01 .. 3600
//   61.332                                   one round-trip time in ms per line, 0 .. 60000,
//   -1                                       or -1: no network, an outage until the next sample
//
// Further lines that begin with # and empty lines are skipped. Between two samples the value is
// interpolated; towards an outage the last one holds. The trace repeats from its beginning. Pure.
#pragma once

#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "interneuron/time.h"

namespace interneuron::emu {

struct DelayTrace {
  std::string source;
  Duration step = std::chrono::seconds(1);
  // At least two samples, of which one is not negative. A negative one means that there was no
  // network.
  std::vector<double> rtt_ms;

  struct Sample {
    double rtt_ms = 0;
    bool out = false;
  };
  // The value at `t`, which is since the beginning of the trace and not negative.
  Sample at(Duration t) const;
  Duration length() const { return step * static_cast<std::int64_t>(rtt_ms.size()); }
};

// The error is "line 7: …", without the file's name. The last line must end in a newline: one that
// does not was cut off.
std::variant<DelayTrace, std::string> parse_delay_trace(std::string_view text);

}  // namespace interneuron::emu
