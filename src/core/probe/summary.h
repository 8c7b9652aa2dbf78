// From the log of a Measurement to what `interneuron probe` says of a path: losses there and back,
// round trips, one-way variation, bursts. Pure functions and values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/probe/packet_log.h"
#include "interneuron/units.h"

namespace interneuron::probe {

// Trains of back-to-back packets: their dispersion at the far end is the rate of the path's
// narrowest place, or less with other traffic there (docs/constants.md, "Rate of a link").
//
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

struct Distribution {
  // While this is 0 the other fields mean nothing.
  std::size_t samples = 0;
  Duration min{};
  // Quantiles by nearest rank.
  Duration p50{};
  Duration p95{};
  Duration max{};
  double mean_ns = 0;
  double stddev_ns = 0;
};
Distribution distribution_of(std::vector<Duration> samples);

enum class Fate : std::uint8_t { kAnswered, kLate, kLostUp, kLostDown, kLost };

// The fate of every packet, indexed like the log; entries that are no pings mean nothing.
//
// A `stateful` reflector numbers what it receives. Each of its numbers that was never seen is a
// reply lost on the way back; every other unanswered ping was lost on the way there. How many were
// lost either way between two answers is exact, which of them is a guess; behind the last answer
// nothing is known, and the fate is kLost.
//
// A reply that took longer than `timeout` is kLate. `counted_twice` are the reflector's numbers of
// replies that came again.
std::vector<Fate> fates_of(const PacketLog& log, Duration timeout, bool stateful,
                           const std::vector<std::uint32_t>& counted_twice);

struct Summary {
  // Pings sent. The next five fields add up to it.
  std::size_t sent = 0;
  // Answered within the timeout.
  std::size_t answered = 0;
  // Answered after the timeout.
  std::size_t late = 0;
  std::size_t lost_up = 0;
  std::size_t lost_down = 0;
  // Lost one way or the other: the reflector does not count, or no answer came behind them.
  std::size_t lost = 0;
  // The reflector numbers what it receives.
  bool stateful = false;
  // Replies that came again.
  std::size_t duplicates = 0;
  // Replies with a number below one seen before (RFC 4737 §3).
  std::size_t reordered = 0;
  // Runs of pings that were lost one after the other, and pings in the longest of them.
  std::size_t bursts = 0;
  std::size_t longest_burst = 0;
  // Packets sent in trains, and how many of them were answered.
  std::size_t train_packets = 0;
  std::size_t train_answered = 0;
  // Trains that told a rate.
  std::size_t trains = 0;
  // Round trips of the pings, without the reflector's own time (t3 - t2).
  Distribution rtt;
  // One-way delay there and back, above the least of the 15 s around each ping.
  Distribution variation_up;
  Distribution variation_down;
  // Rates there and back, IP and UDP headers included.
  std::optional<DataRate> rate_up;
  std::optional<DataRate> rate_down;

  std::size_t all_lost() const { return lost_up + lost_down + lost; }
  double loss() const {
    return sent == 0 ? 0 : static_cast<double>(all_lost()) / static_cast<double>(sent);
  }
  double reordered_ratio() const {
    const std::size_t received = answered + late;
    return received == 0 ? 0 : static_cast<double>(reordered) / static_cast<double>(received);
  }
  double mean_burst() const {
    return bursts == 0 ? 0 : static_cast<double>(all_lost()) / static_cast<double>(bursts);
  }
};

// Fills the fields of `out` that follow from the log: counts, bursts and distributions. Reads
// out.stateful.
void summarise(const PacketLog& log, Duration timeout,
               const std::vector<std::uint32_t>& counted_twice, Summary& out);

}  // namespace interneuron::probe
