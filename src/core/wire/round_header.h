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

inline constexpr std::size_t kRoundHeaderBytes = 100;

// Times relative to D_N in steps of D_N / 16384; finer than what any decision depends on, and four
// deadlines fit 16 bits.
inline constexpr std::int64_t kDeadlineSteps = 16384;

// The end-to-end time of a decided round: 0 = not known, kE2eNever = later than can be told, or
// never.
inline constexpr std::uint16_t kE2eNever = 65535;

// level_used and variant_used of a round in which nothing was computed yet.
inline constexpr std::uint8_t kNoneUsed = 255;

struct RoundHeader {
  RoundRef round;
  std::uint8_t stage = 1;   // the communication stage that carries this message, 1 … stages
  std::uint8_t stages = 1;  // N
  std::uint16_t communication = 1;  // bit i: stage i + 1 is a communication
  std::uint8_t variant = 0;
  std::uint8_t best_planned = 0;  // the best variant that the sender's plan holds
  bool degraded = false;
  MessageClass message_class = MessageClass::kData;
  std::array<std::uint8_t, 4> needs{};  // weight per Nature field, 1/255
  std::uint32_t policy = 0;             // policy_id() of the policy that planned it
  PeerTime t0{};                        // on the origin's clock
  // Sum of the estimated clock offsets α̂ of the hops so far; 0 from the origin.
  Duration alpha_sum{};
  std::int16_t x_permille = 0;    // X
  std::uint32_t deadline_us = 0;  // D_N
  std::uint32_t period_us = 0;
  Indicator indicator{};
  GuardKind guard = GuardKind::kPaper;
  std::uint8_t level_used = kNoneUsed;    // of the last computation
  std::uint8_t variant_used = kNoneUsed;  // of that computation's input
  std::uint8_t local_quality = 0;         // of an answer without a remote result, 1/255
  std::uint16_t target = 0;               // P(on time) that is to be kept, 1/65536
  std::uint16_t miss_price = 0;           // in quality, 1/1000
  // What the round had lost when that computation began, against the node's own reference; steps.
  std::int16_t excess = 0;
  std::uint16_t computed = 0;                         // by all computations so far; steps
  std::array<std::uint16_t, kIndicatorRounds> e2e{};  // of the rounds before, as indicator; steps
  friend bool operator==(const RoundHeader&, const RoundHeader&) = default;

  bool is_communication(std::size_t stage_number) const {
    return stage_number >= 1 && stage_number <= stages &&
           ((communication >> (stage_number - 1)) & 1U) != 0;
  }
  Duration deadline() const { return std::chrono::microseconds(deadline_us); }

  // Steps of D_N / 16384 and back; to_steps() keeps within [low, high].
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
