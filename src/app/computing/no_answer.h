// The message by which a roadside unit tells a vehicle that a round will get no result, so that the
// vehicle takes its local one at once and does not wait for the deadline. Sent as a plain message
// (send()) on kNoAnswerChannel; lost, it changes nothing, since the deadline decides then.
//
// Wire format, big-endian, 16 bytes:
//
//   offset size field
//        0    2 magic 0x4E41, "NA"
//        2    1 version, 1
//        3    1 why: 0 crowded out, 1 too late, 2 unreadable
//        4    4 session of the round's origin
//        8    1 pipeline
//        9    3 zero
//       12    4 round
//
// Pure functions, safe on any bytes. Who receives it believes it only from the peer that the round
// was sent to, which could as well have sent nothing.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "interneuron/round.h"
#include "interneuron/units.h"

namespace interneuron::computing {

// Why a job ends without a result.
enum class NoAnswer : std::uint8_t {
  // Newer jobs of the same peer took its place in the line.
  kCrowdedOut = 0,
  // Its round is over, or even the quickest computation would end after it.
  kTooLate = 1,
  // What was sent is no input, or one that takes too long to decode.
  kUnreadable = 2,
};
// "crowded out", "too late", "unreadable".
std::string_view to_string(NoAnswer why);

// The channel of plain messages on which a roadside unit says so.
inline constexpr std::uint16_t kNoAnswerChannel = 0x4E41;

// A round that gets no result.
struct Unanswered {
  RoundRef round;
  // Whose job it was; not in the message.
  PeerId from{};
  NoAnswer why{};
};

Bytes encode_no_answer(const Unanswered& unanswered);
// What the message says, with `from` left at its default; nothing for bytes that are none.
std::optional<Unanswered> parse_no_answer(ByteView bytes);

}  // namespace interneuron::computing
