// What both directions of one link share: the delay process, the outages (times without radio) and
// the carrier's NAT. Owned by both LinkModels of a Link. Thread-compatible; pure; no errors; times
// are since the start of the link.
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
    // Probability per packet.
    double loss = 0;
    // There is no radio: every packet is lost.
    bool out = false;
  };
  // The conditions at `t`. Calls may go back by up to DelayProcess::kMemory.
  Sample at(Duration t);

  // Takes another process, other outages and another NAT; their time begins at `now`.
  void replace(Duration now, std::shared_ptr<DelayProcess> process, const PeriodicOutage& outages,
               const NatParams& nat);
  // Uses this round-trip time instead of the process's from now on, until replace().
  void fix_rtt(Duration rtt) { fixed_rtt_ = rtt; }
  // Adds an outage [from, from + length); overlapping ones are joined.
  void add_outage(Duration from, Duration length);

  const NatParams& nat() const { return nat_; }
  // A packet has gone up, which makes or renews the NAT's mapping.
  void touch_mapping(Duration now) { last_up_ = now; }
  // Whether the NAT has no mapping, so that packets down are dropped.
  bool mapping_lost(Duration now) const;
  // A packet of either direction has come, whose direction has these values (DirectionParams).
  // Returns when the radio is awake to carry it.
  Duration awake(Duration now, Duration wake_after, Duration wake_by);

  const std::shared_ptr<DelayProcess>& process() const { return process_; }

 private:
  struct Interval {
    Duration from{};
    Duration to{};
  };
  bool in_outage(Duration t) const;

  std::shared_ptr<DelayProcess> process_;
  // When the time of the process and of the periodic outages began.
  Duration origin_{};
  std::optional<Duration> fixed_rtt_;
  PeriodicOutage periodic_;
  NatParams nat_;
  // Disjoint and in order of time.
  std::vector<Interval> outages_;
  // When the last packet went up; empty: none has.
  std::optional<Duration> last_up_;
  // When the last packet came, in either direction; empty: none has. And from when on the radio is
  // awake.
  std::optional<Duration> last_packet_;
  Duration awake_at_{};
};

}  // namespace interneuron::emu
