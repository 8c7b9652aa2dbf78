#include "app/computing/no_answer.h"

#include <array>

namespace interneuron::computing {
namespace {

constexpr std::uint32_t kMagic = 0x4E41;
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kWords = 4;
constexpr std::size_t kBytes = 4 * kWords;
// The newest reason that there is.
constexpr std::uint32_t kLastReason = static_cast<std::uint32_t>(NoAnswer::kUnreadable);

}  // namespace

std::string_view to_string(NoAnswer why) {
  switch (why) {
    case NoAnswer::kCrowdedOut:
      return "crowded out";
    case NoAnswer::kTooLate:
      return "too late";
    case NoAnswer::kUnreadable:
      break;
  }
  return "unreadable";
}

Bytes encode_no_answer(const Unanswered& unanswered) {
  const RoundRef& round = unanswered.round;
  const std::array<std::uint32_t, kWords> words = {
      (kMagic << 16) | (kVersion << 8) | static_cast<std::uint32_t>(unanswered.why),
      round.origin.value, std::uint32_t{round.pipeline.value} << 24, round.round.value};
  Bytes out;
  out.reserve(kBytes);
  for (const std::uint32_t word : words) {
    for (int shift = 24; shift >= 0; shift -= 8) {
      out.push_back(static_cast<std::byte>((word >> shift) & 0xFF));
    }
  }
  return out;
}

std::optional<Unanswered> parse_no_answer(ByteView bytes) {
  if (bytes.size() != kBytes) return std::nullopt;
  std::array<std::uint32_t, kWords> words{};
  for (std::size_t i = 0; i < kBytes; ++i) {
    words[i / 4] = (words[i / 4] << 8) | std::to_integer<std::uint32_t>(bytes[i]);
  }
  const std::uint32_t why = words[0] & 0xFF;
  const bool sound = words[0] >> 8 == ((kMagic << 8) | kVersion) && why <= kLastReason &&
                     (words[2] & 0xFFFFFF) == 0;
  if (!sound) return std::nullopt;
  Unanswered out;
  out.why = static_cast<NoAnswer>(why);
  out.round = {SessionId{words[1]}, PipelineId{static_cast<std::uint8_t>(words[2] >> 24)},
               RoundId{words[3]}};
  return out;
}

}  // namespace interneuron::computing
