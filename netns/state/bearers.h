// The links of a running testbed as models, whatever back end carries the packets: made from the
// options, changed by requests and by events, their schedule and counters published to shared
// memory. Thread-compatible. Errors: the constructor throws TestbedError.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
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
  // `control` and `stats` outlive this. Requests for what `backend` cannot do are refused.
  Bearers(const TestbedOptions& options, Backend backend, ControlServer& control,
          SharedStats& stats);

  // Links in the order of State::links.
  std::size_t size() const { return links_.size(); }
  emu::Link& link(std::size_t index) { return *links_[index]; }
  SharedLink& shared(std::size_t index) { return stats_.link(index); }
  SharedStats& stats() { return stats_; }

  // The first packet has come: the links' time begins.
  void start(TimePoint epoch);
  std::optional<TimePoint> epoch() const { return epoch_; }
  // Time of the links; 0 before the epoch.
  Duration since_epoch(TimePoint now) const;

  // Applies the events that are due and publishes the schedule so far. To be called every
  // kAdvanceInterval or oftener; a call without anything to do costs little.
  void advance(TimePoint now);
  static constexpr Duration kAdvanceInterval = emu::kDelayStep;

  // Has `serve` called, within serve(), when `fd` is readable; both outlive this.
  void attend(int fd, std::function<void()> serve);
  // Readable when a request waits or what attend() named; serve() looks after it. Never blocks.
  int attention_fd() const { return attention_.get(); }
  void serve(TimePoint now);

 private:
  void publish(std::size_t index, std::int64_t step);
  std::string obey(const Request& request, Duration time);

  Backend backend_;
  ControlServer& control_;
  io::FileDescriptor attention_;  // epoll
  std::vector<std::function<void()>> attended_;
  SharedStats& stats_;
  std::vector<std::unique_ptr<emu::ScenarioPlayer>> vehicles_;
  std::vector<emu::Link*> links_;  // theirs
  std::optional<TimePoint> epoch_;
  TimePoint now_{};         // during serve()
  std::int64_t steps_ = 0;  // published
};

}  // namespace interneuron::netns
