// Trains of back-to-back packets: their dispersion at the far end is the rate of the path's
// narrowest place, or less with other traffic there (docs/constants.md, "Rate of a link"). Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "core/probe/packet_log.h"
#include "interneuron/units.h"

namespace interneuron::probe {

// So many leading packets do not count: they meet an idle path and slots of the radio that they
// have to wait for.
inline constexpr std::size_t kTrainLeadIn = 2;
// Packets that a train needs behind these.
inline constexpr std::size_t kTrainMinPackets = 16;
// Uplink grants come in bursts of 1 to 10 ms; what took less says nothing.
inline constexpr Duration kTrainMinDispersion = std::chrono::milliseconds(5);
inline constexpr std::size_t kTrainMaxPackets = 256;  // = wire::kMaxEchoTrain

// The rate at which the packets that arrived at these instants were carried, each of `ip_bytes`;
// nothing if they are too few or took too little time to tell. The longest train is believed from
// 1 ms on: nothing longer can be sent.
std::optional<DataRate> dispersion_rate(std::vector<std::int64_t> arrivals_ns, std::size_t ip_bytes,
                                        std::size_t train_packets);

// How many packets the next train needs, when the fastest direction seems to carry `rate` (0:
// not known).
std::size_t train_length(DataRate rate, std::size_t ip_bytes);

struct TrainRates {
  std::optional<DataRate> up;    // by the reflector's receive instants
  std::optional<DataRate> down;  // by the prober's; only of held trains
  DataRate rough{};              // the faster one, however short; for the next train's length
};
TrainRates rates_of(std::span<const SentPacket> train, std::size_t ip_bytes, bool held);

// The middle one, the lower of two.
std::optional<DataRate> median(std::vector<DataRate> rates);

}  // namespace interneuron::probe
