// From the log of a Measurement to what `interneuron probe` says of a path: losses there and back,
// round trips, one-way variation, bursts. Pure functions and values.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/probe/packet_log.h"
#include "interneuron/units.h"

namespace interneuron::probe {

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
