// What both directions of one link share: the delay process, the times without radio and the
// carrier's NAT. Thread-compatible; pure; times are since the start of the link.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "lab/emu/conditions.h"
#include "lab/emu/delay_process.h"

namespace interneuron::emu {

class Channel {
 public:
  explicit Channel(std::shared_ptr<DelayProcess> process, const PeriodicOutage& outages = {},
                   const NatParams& nat = {});

  struct Sample {
    Duration one_way{};
    double loss = 0;
    bool out = false;
  };
  // As DelayProcess::at(): may go back by kMemory.
  Sample at(Duration t);

  // From `now` on another process, other outages and another NAT, whose time begins there.
  void replace(Duration now, std::shared_ptr<DelayProcess> process, const PeriodicOutage& outages,
               const NatParams& nat);
  // From now on this round-trip time instead of the process's, until replace().
  void fix_rtt(Duration rtt) { fixed_rtt_ = rtt; }
  // No radio in [from, from + length); overlapping ones unite.
  void add_outage(Duration from, Duration length);

  const NatParams& nat() const { return nat_; }
  // A packet went up: the NAT's mapping is fresh.
  void touch_mapping(Duration now) { last_up_ = now; }
  bool mapping_lost(Duration now) const;

  const std::shared_ptr<DelayProcess>& process() const { return process_; }

 private:
  struct Interval {
    Duration from{};
    Duration to{};
  };
  bool in_outage(Duration t) const;

  std::shared_ptr<DelayProcess> process_;
  Duration origin_{};  // of the process and the periodic outages
  std::optional<Duration> fixed_rtt_;
  PeriodicOutage periodic_;
  NatParams nat_;
  std::vector<Interval> outages_;  // disjoint, in order
  std::optional<Duration> last_up_;
};

}  // namespace interneuron::emu
