// The program `road` as our child in a testbed, for commands that start both ends.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/process/child.h"
#include "netns/state/state.h"

namespace interneuron::cli {

// The path of this very program. Throws Failure (1).
std::string own_program();

// Ended and reaped at the latest by the destructor. Thread-compatible.
class RoadChild {
 public:
  // Starts `argv` in the roadside's namespace and returns when vehicles may come. `stderr_fd`: -1
  // inherits ours. Throws Failure (1; 128 + signal).
  RoadChild(const netns::State& state, const std::vector<std::string>& argv, int stderr_fd = -1);
  ~RoadChild();
  RoadChild(const RoadChild&) = delete;
  RoadChild& operator=(const RoadChild&) = delete;

  // As it told when it was ready.
  struct Ladder {
    std::string description;
    std::vector<std::string> names;
    std::vector<Duration> medians;
  };
  const Ladder& ladder() const { return ladder_; }
  void end();

 private:
  int fd_ = -1;  // of its stdout
  std::optional<Child> child_;
  Ladder ladder_;
};

}  // namespace interneuron::cli
