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
// The most packets of a train that a reflector holds: wire::kMaxEchoTrain.
inline constexpr std::size_t kTrainMaxPackets = 256;

// The rate at which packets of `ip_bytes` each were carried that arrived at these instants (ns, any
// order, one clock). Nothing if more than a tenth of the least train is missing or if they arrived
// within too little time to tell; a train of kTrainMaxPackets is believed from 1 ms on, because
// nothing longer can be sent.
std::optional<DataRate> dispersion_rate(std::vector<std::int64_t> arrivals_ns, std::size_t ip_bytes,
                                        std::size_t train_packets);

// How many packets the next train needs so that it takes kTrainMinDispersion to arrive over a path
// whose faster direction seems to carry `rate` (0: not known).
std::size_t train_length(DataRate rate, std::size_t ip_bytes);

struct TrainRates {
  // By the instants at which the reflector received the packets.
  std::optional<DataRate> up;
  // By the instants at which the replies came back; only if the reflector held the replies.
  std::optional<DataRate> down;
  // The faster of both, however short the train was; sets the length of the next train.
  DataRate rough{};
};
// What one train tells. `held`: the reflector sent its replies back to back.
TrainRates rates_of(std::span<const SentPacket> train, std::size_t ip_bytes, bool held);

// The middle one; of an even number the lower of the two in the middle.
std::optional<DataRate> median(std::vector<DataRate> rates);

}  // namespace interneuron::probe
