// The round header (NOTES §4): what opens every message. docs/wire_format.md is the authority.
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

inline constexpr std::size_t kRoundHeaderBytes = 64;

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
  Duration alpha_sum{};                 // α̂ of the hops so far (NOTES §4.2); 0 from the origin
  std::int16_t x_permille = 0;          // X
  std::uint32_t deadline_us = 0;        // D_N
  std::uint32_t period_us = 0;
  Indicator indicator{};
  friend bool operator==(const RoundHeader&, const RoundHeader&) = default;

  bool is_communication(std::size_t stage_number) const {
    return stage_number >= 1 && stage_number <= stages &&
           ((communication >> (stage_number - 1)) & 1U) != 0;
  }
  Duration deadline() const { return std::chrono::microseconds(deadline_us); }
};

// 32-bit FNV-1a of a policy's name: both ends need only agree on the name.
std::uint32_t policy_id(std::string_view name);

// The header of a complete message, if its first kRoundHeaderBytes are one. The payload is what
// follows.
std::optional<RoundHeader> parse_round_header(ByteView message);
void write_round_header(std::span<std::byte, kRoundHeaderBytes> out, const RoundHeader& header);

}  // namespace interneuron::wire
