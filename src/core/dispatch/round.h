// A round as the nodes of its pipeline know it.
#pragma once

#include <cstdint>
#include <optional>

#include "core/guard/round_guard.h"
#include "core/guard/stage_guard.h"
#include "core/wire/round_header.h"
#include "interneuron/message.h"
#include "interneuron/round.h"

namespace interneuron::dispatch {

// What every message of a round tells of it, in the terms of guards and policies. A node keeps one
// while it has a message of the round or works on it, and tells the next node the same, with what
// it has added. Whatever came with a peer's header may be false, but it is well-formed, and nothing
// computed from it leaves the range of its type. A plain value; pure.
struct Round {
  RoundRef ref;
  // The communication that carries the message, 1 … stages; and all stages of the pipeline.
  std::uint8_t stage = 1;
  std::uint8_t stages = 1;
  // Bit i is set when stage i + 1 is a communication.
  std::uint16_t communication = 1;
  // Which variant the message is, the best one that its sender has planned, and whether its sender
  // gave up quality for time.
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;
  bool degraded = false;
  // The deadline, as the origin states it, counts from t0.
  QoS qos;
  // The id of the policy that plans its messages (PolicyRegistry).
  std::uint32_t policy = 0;
  // When it began, on the origin's clock, and the sum of the clock offsets of the hops since then.
  PeerTime t0{};
  Duration alpha_sum{};
  // What the guards have to go by: the tolerance X in 1/1000, what the origin asks, and what became
  // of the 16 rounds before.
  std::int16_t x_permille = 0;
  guard::Terms terms;
  Indicator indicator{};
  guard::RecentE2e recent_e2e{};
  // The level and the input of the last computation, nothing before the first; how late the round
  // was when it began; and how long all computations took.
  std::optional<std::uint8_t> level_used;
  std::optional<std::uint8_t> variant_used;
  Duration excess{};
  Duration computed{};

  bool is_communication(std::size_t stage_number) const {
    return stage_number >= 1 && stage_number <= stages &&
           ((communication >> (stage_number - 1)) & 1U) != 0;
  }
  // The end of a stage, for the guards.
  guard::StageEnd stage_end(std::size_t stage_number) const;
  // What the computations took, for the guard at the origin.
  guard::Spent spent() const;
  // A computation has begun at this level.
  void note_level(const guard::LevelChoice& choice);
  // A computation on this variant has ended after `took`.
  void note_computed(Duration took);
};

// The round that a header tells of.
Round round_of(const wire::RoundHeader& header);
// The header that tells of a round. Its times are rounded to steps of the deadline.
wire::RoundHeader header_of(const Round& round);
// The same round with its times rounded as others read them, so that its origin, and a node at
// which several stages end, decide by the same numbers as everybody else.
inline Round as_told(const Round& round) { return round_of(header_of(round)); }

}  // namespace interneuron::dispatch
