// The keys of profiles that changes and scenarios have, too: names, meanings and ranges, once.
// Private to src/lab/emu. Pure.
#pragma once

#include <span>

#include "app/toml/toml_reader.h"
#include "lab/emu/link_change.h"

namespace interneuron::emu {

// Ranges are wide: they are to catch typing errors and wrong units, not unlikely networks. A round
// trip is a minute at most, a length of time a day, an instant 116 days from the start, and a queue
// holds one Ethernet packet at least.
inline constexpr double kMaxRttMs = 60'000;
inline constexpr double kMaxSeconds = 86'400;
inline constexpr double kMaxInstantS = 1e7;
inline constexpr double kMinQueueKbyte = 1.5;
inline constexpr double kMinRateMbit = 0.001;
inline constexpr double kMaxRateMbit = 100'000;

inline constexpr toml_reader::NumberKey kRttKey{"rtt_ms", "round-trip time", 0, kMaxRttMs, "ms"};
inline constexpr toml_reader::NumberKey kLossKey{"loss", "probability that a packet is lost", 0, 1,
                                                 ""};
inline constexpr toml_reader::NumberKey kRateKey{"rate_mbit", "rate of IP packets", kMinRateMbit,
                                                 kMaxRateMbit, "Mbit/s"};

inline Duration seconds(double s) { return from_ms(s * 1e3); }

// A key of [up] and [down], and of changes. All are optional.
struct DirectionKey {
  toml_reader::NumberKey key;
  void (*set)(DirectionChange& change, double value);
};
std::span<const DirectionKey> direction_keys();

}  // namespace interneuron::emu
