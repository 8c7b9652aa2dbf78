// The links of a running testbed as models, for either back end that carries the packets: made from
// the options, changed by requests (control.h) and by the scenario's events, with their schedule
// published to shared memory. Lives in the holder, which calls it from its loop.
//
// Owns the models. A request comes from another process: it is checked as a whole before anything
// is changed, and a wrong one is answered with the reason. Thread-compatible. Errors: the
// constructor throws TestbedError; afterwards none.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "interneuron/time.h"
#include "lab/emu/scenario_player.h"
#include "netns/state/control.h"
#include "netns/state/options.h"
#include "netns/state/shared_stats.h"
#include "netns/state/state.h"

namespace interneuron::netns {

class Bearers {
 public:
  // `control` and `stats` must outlive this. Requests for what `backend` cannot do are refused.
  Bearers(const TestbedOptions& options, Backend backend, ControlServer& control,
          SharedStats& stats);

  // The links and their shared counters, in the order of State::links.
  std::size_t size() const { return links_.size(); }
  emu::Link& link(std::size_t index) { return *links_[index]; }
  // The cell that the link's packets pass behind it, shared with other links and vehicles; nullptr:
  // none.
  emu::Cell* cell(std::size_t index, emu::Direction direction);
  // All cells: first up, then down, of each of the scenario.
  std::span<emu::Cell> cells() { return cells_; }
  // Writes what the cells have carried to shared memory.
  void publish_cells(TimePoint now);
  SharedLink& shared(std::size_t index) { return stats_.link(index); }
  SharedStats& stats() { return stats_; }

  // Begins the links' time: `epoch` is when the first packet came.
  void start(TimePoint epoch);
  // Empty before the first packet.
  std::optional<TimePoint> epoch() const { return epoch_; }
  // The time of the links at `now`; 0 before the epoch.
  Duration since_epoch(TimePoint now) const;

  // Applies the events that are due and publishes the schedule up to `now`. To be called at least
  // every kAdvanceInterval; a call without anything to do costs little.
  void advance(TimePoint now);
  static constexpr Duration kAdvanceInterval = emu::kDelayStep;

  // Makes serve() call `serve` whenever `fd` is readable. The caller keeps the descriptor open as
  // long as this lives.
  void attend(int fd, std::function<void()> serve);
  // attention_fd() is readable when a request or a descriptor of attend() waits; serve() then
  // handles all of them without blocking.
  int attention_fd() const { return attention_.get(); }
  void serve(TimePoint now);

 private:
  void publish(std::size_t index, std::int64_t step);
  std::string carry_out(const Request& request, Duration time);

  Backend backend_;
  ControlServer& control_;
  // An epoll descriptor over the control socket and the descriptors of attend().
  io::FileDescriptor attention_;
  std::vector<std::function<void()>> attended_;
  SharedStats& stats_;
  std::vector<std::unique_ptr<emu::ScenarioPlayer>> vehicles_;
  // The links of all vehicles_, which own them.
  std::vector<emu::Link*> links_;
  std::optional<TimePoint> epoch_;
  // The argument of serve() while that runs.
  TimePoint now_{};
  std::vector<emu::Cell> cells_;
  // How many steps of the schedule have been published.
  std::int64_t steps_ = 0;
};

}  // namespace interneuron::netns
