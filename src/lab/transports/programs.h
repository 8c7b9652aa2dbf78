// The programs of a run, as `bench play --order FILE --end WHICH` runs them, which no help shows,
// and as the command sees them: children in the hosts of a testbed.
#pragma once

#include <filesystem>
#include <string>

#include "app/process/child.h"
#include "interneuron/time.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "node/io/file_descriptor.h"

namespace interneuron::transports {

inline constexpr const char* kVehiclesEnd = "vehicles";
inline constexpr const char* kRoadEnd = "road";
// Those of the cross traffic, at the vehicle and at the roadside unit.
inline constexpr const char* kCrossEnd = "cross";
inline constexpr const char* kCrossRoadEnd = "cross_road";

// Plays one end of the order in this file to its end and leaves its record. Says on stdout "ready"
// when it is, the vehicles with the instant at which messages begin. Returns an exit code; throws
// Failure.
int play_end(const std::filesystem::path& order, const std::string& end);

// One of them, as our child. It is ended and reaped by the destructor if not before. Its stderr
// goes to a file beside the order. Thread-compatible.
class EndProgram {
 public:
  EndProgram(const netns::State& state, netns::Host host, const std::filesystem::path& order,
             const std::string& end);

  // What it says behind "ready". Throws Failure: 1 with its last words when it ends before, or
  // takes too long, 128 + signal when we are interrupted.
  std::string await_ready();
  // Waits for its end, or brings it about. Throws Failure (1) with its last words when it failed.
  void finish();
  void end();

 private:
  void judge(int code) const;
  std::string last_words() const;

  std::string end_;
  std::filesystem::path log_;
  io::FileDescriptor stdout_;
  process::Child child_;
};

}  // namespace interneuron::transports
