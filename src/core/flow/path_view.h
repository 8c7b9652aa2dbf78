// What the sender is told of a path.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/code/redundancy.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Stands for a time beyond any that is planned with, so that sums of times stay in range.
inline constexpr Duration kNever = std::chrono::hours(1);

// The rate before anything is known of a path, which a start-up train measures within a round
// trip: that of a weak 4G uplink. The pace has the same headroom as that of a known rate,
// RateEstimator::kHeadroom.
inline constexpr DataRate kBlindRate{20'000'000};
inline constexpr DataRate kBlindPace{25'000'000};

// What the sender must know of a path; refreshed by set_path() whenever the estimates move.
struct PathView {
  // While it is false nothing is sent on the path.
  bool up = true;
  // It may have fallen silent: see Sender::doubt().
  bool suspect = false;
  // Retransmissions prefer the other paths.
  bool backup = false;
  // The rate that the path delivers, to plan with, and the pace at which packets leave. While they
  // are not known, kBlindRate and kBlindPace stand in.
  std::optional<DataRate> rate;
  std::optional<DataRate> pace;
  // What the path may carry soon: what cannot arrive even so is given up.
  std::optional<DataRate> soon;
  // The expected one-way delay, and the least one of late; zero while they are not known.
  Duration one_way{};
  Duration least_one_way{};
  // How much the delay varies: RTTVAR of RFC 6298.
  Duration jitter{};
  // Bytes that may be in flight, with IP headers.
  std::size_t window = SIZE_MAX;
  // The path carries all it can: what is in flight beyond an empty path waits in a queue.
  bool loaded = false;
  // What is data-sized leaves with ECT.
  bool ect = false;
  // A fragment that has been in flight for so long without any acknowledgement is lost.
  Duration probe_timeout{};
  // What is expected of losses.
  code::Losses losses{};

  DataRate planned_rate() const { return rate.value_or(kBlindRate); }
  // How long so many bytes take to leave at the rate that is planned with.
  Duration air_time(std::size_t bytes) const {
    return std::min<Duration>(planned_rate().transmit_time(bytes), kNever);
  }
};

}  // namespace interneuron::flow
