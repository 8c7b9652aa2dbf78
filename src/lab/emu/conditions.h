// What one link and one direction of it are like, as values: the vocabulary of profiles, changes
// and back ends. Pure.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"
#include "lab/emu/bottleneck.h"

namespace interneuron::emu {

// kUp: vehicle -> roadside, kDown: roadside -> vehicle.
enum class Direction : std::uint8_t { kUp, kDown };
inline constexpr std::size_t kDirections = 2;

// Loss in bursts (Gilbert 1960, Elliott 1963), per packet, as `netem loss gemodel p r 1-h 1-k`: in
// the good state a packet is lost with probability loss_in_good and the state turns bad with p; in
// the bad one loss_in_bad and r. With the defaults a burst has 1/r packets in the mean.
struct GilbertElliott {
  double p = 0;
  double r = 1;
  double loss_in_good = 0;  // 1 - k
  double loss_in_bad = 1;   // 1 - h
  friend bool operator==(const GilbertElliott&, const GilbertElliott&) = default;
};

struct DirectionParams {
  // Of the bottleneck; IP bytes count. <= 0: nothing passes. With `trace` its long-run mean.
  DataRate rate{};
  // Drop-tail limits of what waits for the bottleneck, see LinkModel::enqueue().
  std::size_t queue_bytes = 0;
  std::size_t queue_packets = 0;     // 0: only bytes count
  std::optional<RateTrace> trace{};  // the rate in time, instead of `rate`
  // Probabilities per packet.
  std::optional<double> loss{};                     // instead of that of the radio state
  std::optional<GilbertElliott> gilbert_elliott{};  // beside `loss`
  double duplicate = 0;
  double corrupt = 0;  // one bit flipped; the checksum then lets the receiver drop it
  // A packet overtakes: it arrives reorder_by earlier than in order, at the soonest when it has
  // left the bottleneck. netem's `reorder` is the case of a reorder_by of the whole delay.
  double reorder = 0;
  Duration reorder_by = kWholeDelay;
  std::size_t mtu = 0;  // IP bytes; larger packets vanish (a path MTU black hole); 0: none

  static constexpr Duration kWholeDelay = std::chrono::minutes(1);
};

// What carrier-grade NATs and tunnels are known to do to packets. 0 switches each off.
struct NatParams {
  std::size_t drop_below = 0;     // IP bytes; smaller packets vanish
  std::size_t reorder_above = 0;  // IP bytes; larger ones arrive `reorder_delay` late, others pass
  double reorder = 0;             // probability of that, per packet larger than reorder_above
  Duration reorder_delay{};
  // Packets down vanish once no packet up has come through for this long, or ever.
  Duration idle_timeout{};
};

// No radio in [first + k * every, + length), k = 0, 1, …; every 0: once; length 0: never.
struct PeriodicOutage {
  Duration first{};
  Duration length{};
  Duration every{};
};

// What one direction is like at one instant, for a back end that can only set parameters.
struct Conditions {
  Duration one_way{};  // half the round trip, without the bottleneck
  double loss = 0;     // 1 in an outage; without gilbert_elliott's
  std::optional<GilbertElliott> gilbert_elliott{};
  DataRate rate{};  // of a trace: the mean over the next kConditionsSpan
  std::size_t queue_bytes = 0;
  std::size_t queue_packets = 0;  // 0: only bytes count
  double duplicate = 0;
  double corrupt = 0;
  double reorder = 0;
  Duration reorder_by{};  // at most one_way
  std::size_t mtu = 0;    // 0: none
};

// How often a back end that follows Conditions should ask: netem is changed in 10 us
// (docs/constants.md, "The testbed on a machine"), so 50 times a second cost nothing.
inline constexpr Duration kConditionsSpan = std::chrono::milliseconds(20);

}  // namespace interneuron::emu
