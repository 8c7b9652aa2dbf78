// The round header, which opens every message and carries what the guards need. docs/wire_format.md
// is the authority.
// Pure; never throws.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "interneuron/message.h"
#include "interneuron/pipeline.h"
#include "interneuron/time.h"

namespace interneuron::wire {

inline constexpr std::size_t kRoundHeaderBytes = 98;

// Times on the wire are relative to the end-to-end deadline D_N, in steps of D_N / 16384: 8 µs of
// 130 ms, finer than what any decision depends on, while four deadlines fit 16 bits.
inline constexpr std::int64_t kDeadlineSteps = 16384;

// An end-to-end time that is longer than can be told, or a round that never got a remote result. 0
// stands for a time that is not known.
inline constexpr std::uint16_t kE2eNever = 65535;

// level_used and variant_used of a round in which nothing was computed yet.
inline constexpr std::uint8_t kNoneUsed = 255;

// What a message tells of its round. Every node of a pipeline follows it instead of a configuration
// of its own.
struct RoundHeader {
  RoundRef round;
  // The communication that carries this message, 1 … stages; and all stages of the pipeline.
  std::uint8_t stage = 1;
  std::uint8_t stages = 1;
  // Bit i is set when stage i + 1 is a communication.
  std::uint16_t communication = 1;
  // Which variant this is, and the best one that the sender's plan holds.
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;
  bool degraded = false;
  MessageClass message_class = MessageClass::kData;
  // How much each field of Nature matters, in 1/255.
  std::array<std::uint8_t, 4> needs{};
  // policy_id() of the policy that planned it.
  std::uint32_t policy = 0;
  // When the round began, on the origin's clock.
  PeerTime t0{};
  // Sum of the estimated clock offsets α̂ of the hops so far; 0 from the origin.
  Duration alpha_sum{};
  // The tolerance X of guard kPaper, in 1/1000.
  std::int16_t x_permille = 0;
  // The end-to-end deadline D_N, > 0, and the period of the rounds, in microseconds.
  std::uint32_t deadline_us = 0;
  std::uint32_t period_us = 0;
  Indicator indicator{};
  GuardKind guard = GuardKind::kPaper;
  // The level of the last computation, and the variant of its input.
  std::uint8_t level_used = kNoneUsed;
  std::uint8_t variant_used = kNoneUsed;
  // What an answer without a remote result is worth, in 1/255.
  std::uint8_t local_quality = 0;
  // What a missed round costs, in 1/1000 of quality.
  std::uint16_t miss_price = 0;
  // How late the round was when that computation began, against the node's own reference; in steps.
  std::int16_t excess = 0;
  // The time that all computations so far took, in steps.
  std::uint16_t computed = 0;
  // End-to-end times of the 16 preceding rounds, ordered as `indicator`; in steps.
  std::array<std::uint16_t, kIndicatorRounds> e2e{};
  friend bool operator==(const RoundHeader&, const RoundHeader&) = default;

  bool is_communication(std::size_t stage_number) const {
    return stage_number >= 1 && stage_number <= stages &&
           ((communication >> (stage_number - 1)) & 1U) != 0;
  }
  Duration deadline() const { return std::chrono::microseconds(deadline_us); }

  // From a time to steps, clamped to [low, high], and back. The deadline must be > 0.
  std::int64_t to_steps(Duration d, std::int64_t low, std::int64_t high) const;
  Duration from_steps(std::int64_t steps) const {
    return Duration{deadline().count() * steps / kDeadlineSteps};
  }
};

// What stands for a policy on the wire: the 32-bit FNV-1a hash of its name, so that both ends need
// only agree on the name.
std::uint32_t policy_id(std::string_view name);

// The header that opens a complete message, or nothing if its first kRoundHeaderBytes are no valid
// header; the payload is what follows. Enumerators, counts and the deadline are checked, so that
// nothing behind divides by zero or reads beyond an array. t0, alpha_sum and the indicators may
// still be any value that a peer likes to send.
std::optional<RoundHeader> parse_round_header(ByteView message);
// Writes a header that is valid, which is asserted.
void write_round_header(std::span<std::byte, kRoundHeaderBytes> out, const RoundHeader& header);

}  // namespace interneuron::wire
