// One run: two programs play the ends of an order in the hosts of a testbed.
//
// Real time and a shared machine: what comes of it differs from run to run. Errors: Failure when a
// program fails or a signal comes, for which a SignalWatch must be alive; netns::TestbedError.
// Whatever way a run ends, its programs have ended. Thread-compatible.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lab/transports/order.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"

namespace interneuron::transports {

// Why a run with this transport cannot be made on this machine, one line that does not name it;
// nothing: it can.
std::optional<std::string> lacks(const Transport& transport);

// What a run takes beside its messages and their deadline: the testbed, the programs, their
// meeting. 2.7 s were measured with one vehicle on two busy cores.
inline constexpr Duration kRunOverhead = std::chrono::milliseconds(2700);

// The modems of the first vehicle, as they were set up.
std::vector<Modem> modems_of(const netns::State& state);

struct Played {
  VehiclesRecord vehicles;
  RoadRecord road;
  // Empty without cross traffic.
  CrossRecord cross;
  // When messages began.
  TimePoint begin{};
  // What the testbed had carried when the last message had begun.
  netns::Snapshot after;
  // What makes the figures doubtful, one line; empty: nothing was seen.
  std::string doubt;
};

// Called when messages begin, with that instant; may take as long as messages begin.
using Meanwhile = std::function<void(TimePoint begin)>;

// `order.folder` must be there.
Played play(const netns::State& state, const Order& order, const Meanwhile& meanwhile);

// A folder for the files of a run that only its owner can enter, made if it is not there and
// removed at the end, whatever that is.
class Scratch {
 public:
  explicit Scratch(std::filesystem::path folder);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

 private:
  std::filesystem::path folder_;
};

}  // namespace interneuron::transports
