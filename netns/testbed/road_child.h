// The program `road` as our child in a testbed, for commands that start both ends.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "app/process/child.h"
#include "netns/state/state.h"

namespace interneuron::netns {

// A running roadside unit. It is ended and reaped by the destructor if not before.
// Thread-compatible.
class RoadChild {
 public:
  // Starts `argv` in the roadside's namespace and returns when vehicles may come. Its stderr goes
  // to `stderr_fd`; -1 inherits ours. Throws Failure: 1 when it does not get ready, 128 + signal
  // when we are interrupted.
  RoadChild(const State& state, const std::vector<std::string>& argv, int stderr_fd = -1);
  ~RoadChild();
  RoadChild(const RoadChild&) = delete;
  RoadChild& operator=(const RoadChild&) = delete;

  // What it said of its detectors when it was ready.
  struct Ladder {
    std::string description;
    std::vector<std::string> names;
    std::vector<Duration> medians;
  };
  const Ladder& ladder() const { return ladder_; }
  void end();

 private:
  // Reads its stdout.
  int fd_ = -1;
  std::optional<process::Child> child_;
  Ladder ladder_;
};

}  // namespace interneuron::netns
