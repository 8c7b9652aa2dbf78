#include "wire/round_header.h"

#include <cassert>

#include "wire/bytes.h"

namespace interneuron::wire {
namespace {

constexpr std::uint8_t kVersion = 1;
constexpr std::uint8_t kDegraded = 0x01;

std::uint32_t pack(const Indicator& indicator) {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < indicator.size(); ++i) {
    bits |= static_cast<std::uint32_t>(indicator[i]) << (2 * i);
  }
  return bits;
}

std::optional<Indicator> unpack(std::uint32_t bits) {
  Indicator out{};
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::uint32_t state = (bits >> (2 * i)) & 3U;
    if (state > static_cast<std::uint32_t>(RoundState::kMissed)) return std::nullopt;
    out[i] = static_cast<RoundState>(state);
  }
  return out;
}

bool consistent(const RoundHeader& h) {
  return h.stages >= 1 && h.stages <= kMaxStages && h.stage >= 1 && h.stage <= h.stages &&
         h.is_communication(h.stage) && h.variant < kMaxVariants && h.best_planned <= h.variant &&
         h.round.origin.value != 0 && h.deadline_us > 0 && h.x_permille >= -1000;
}

}  // namespace

std::uint32_t policy_id(std::string_view name) {
  std::uint32_t hash = 2166136261U;  // FNV offset basis
  for (const char c : name) {
    hash ^= static_cast<std::uint8_t>(c);
    hash *= 16777619U;  // FNV prime
  }
  return hash;
}

std::optional<RoundHeader> parse_round_header(ByteView message) {
  if (message.size() < kRoundHeaderBytes) return std::nullopt;
  Reader r(message.first(kRoundHeaderBytes));
  RoundHeader h;
  const auto version = r.get<std::uint8_t>();
  const auto flags = r.get<std::uint8_t>();
  const auto message_class = r.get<std::uint8_t>();
  h.round.pipeline = PipelineId{r.get<std::uint8_t>()};
  h.stage = r.get<std::uint8_t>();
  h.stages = r.get<std::uint8_t>();
  h.communication = r.get<std::uint16_t>();
  h.variant = r.get<std::uint8_t>();
  h.best_planned = r.get<std::uint8_t>();
  h.x_permille = r.get<std::int16_t>();
  for (std::uint8_t& need : h.needs) need = r.get<std::uint8_t>();
  h.round.origin = SessionId{r.get<std::uint32_t>()};
  h.round.round = RoundId{r.get<std::uint32_t>()};
  h.policy = r.get<std::uint32_t>();
  h.deadline_us = r.get<std::uint32_t>();
  h.period_us = r.get<std::uint32_t>();
  const auto indicator = unpack(r.get<std::uint32_t>());
  h.t0 = PeerTime{Duration{r.get<std::int64_t>()}};
  h.alpha_sum = Duration{r.get<std::int64_t>()};
  const auto reserved = r.get<std::uint64_t>();
  if (!r.ok() || version != kVersion || (flags & ~kDegraded) != 0 || reserved != 0 || !indicator ||
      message_class > static_cast<std::uint8_t>(MessageClass::kResult)) {
    return std::nullopt;
  }
  h.degraded = (flags & kDegraded) != 0;
  h.message_class = static_cast<MessageClass>(message_class);
  h.indicator = *indicator;
  if (!consistent(h)) return std::nullopt;
  return h;
}

void write_round_header(std::span<std::byte, kRoundHeaderBytes> out, const RoundHeader& h) {
  assert(consistent(h));
  Writer w(out);
  w.put(kVersion);
  w.put(h.degraded ? kDegraded : std::uint8_t{0});
  w.put(static_cast<std::uint8_t>(h.message_class));
  w.put(h.round.pipeline.value);
  w.put(h.stage);
  w.put(h.stages);
  w.put(h.communication);
  w.put(h.variant);
  w.put(h.best_planned);
  w.put(h.x_permille);
  for (const std::uint8_t need : h.needs) w.put(need);
  w.put(h.round.origin.value);
  w.put(h.round.round.value);
  w.put(h.policy);
  w.put(h.deadline_us);
  w.put(h.period_us);
  w.put(pack(h.indicator));
  w.put(h.t0.time_since_epoch().count());
  w.put(h.alpha_sum.count());
  w.put(std::uint64_t{0});
  assert(w.ok() && w.size() == kRoundHeaderBytes);
}

}  // namespace interneuron::wire
