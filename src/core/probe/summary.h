// From what is known of every packet to what a probe says of a path. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/probe/packet_log.h"
#include "interneuron/units.h"

namespace interneuron::probe {

struct Distribution {
  std::size_t samples = 0;  // 0: the rest means nothing
  Duration min{};
  Duration p50{};  // by nearest rank
  Duration p95{};
  Duration max{};
  double mean_ns = 0;
  double stddev_ns = 0;
};
Distribution distribution_of(std::vector<Duration> samples);

enum class Fate : std::uint8_t { kAnswered, kLate, kLostUp, kLostDown, kLost };

// Every ping has exactly one fate. `stateful`: the reflector counts what arrives, so that a number
// of its that was never seen is a reply lost on the way back, and what else is unanswered was lost
// on the way there; behind the last answer it is not known which. How many between two answers is
// exact, which of them is a guess. Indexed like the log; entries
// that are no pings mean nothing.
std::vector<Fate> fates_of(const PacketLog& log, Duration timeout, bool stateful,
                           const std::vector<std::uint32_t>& counted_twice);

struct Summary {
  std::size_t sent = 0;  // pings
  // These five add up to `sent`.
  std::size_t answered = 0;
  std::size_t late = 0;  // answered after the timeout
  std::size_t lost_up = 0;
  std::size_t lost_down = 0;
  std::size_t lost = 0;  // the reflector does not count, or nothing came behind them
  bool stateful = false;
  std::size_t duplicates = 0;
  std::size_t reordered = 0;  // RFC 4737 §3: replies with a number below one seen before
  std::size_t bursts = 0;     // runs of pings that were lost one after the other
  std::size_t longest_burst = 0;
  std::size_t train_packets = 0;  // sent in trains
  std::size_t train_answered = 0;
  std::size_t trains = 0;             // that told a rate
  Distribution rtt;                   // without the reflector's own time (t3 - t2)
  Distribution variation_up;          // one-way delay above the least of the 15 s around it
  Distribution variation_down;        // the same of the way back
  std::optional<DataRate> rate_up;    // IP and UDP headers included
  std::optional<DataRate> rate_down;  // the same

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

// Fills what follows from the log: the counts, bursts, distributions.
void summarise(const PacketLog& log, Duration timeout,
               const std::vector<std::uint32_t>& counted_twice, Summary& out);

}  // namespace interneuron::probe
