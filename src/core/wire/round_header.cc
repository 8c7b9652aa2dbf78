#include "core/wire/round_header.h"

#include <algorithm>
#include <cassert>

#include "core/wire/bytes.h"

namespace interneuron::wire {
namespace {

constexpr std::uint8_t kRoundHeaderVersion = 3;
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
         h.round.origin.value != 0 && h.deadline_us > 0 && h.x_permille >= -1000 &&
         (h.variant_used < kMaxVariants || h.variant_used == kNoneUsed);
}

}  // namespace

std::uint32_t policy_id(std::string_view name) {
  // FNV's offset basis and, below, its prime.
  std::uint32_t hash = 2166136261U;
  for (const char c : name) {
    hash ^= static_cast<std::uint8_t>(c);
    hash *= 16777619U;
  }
  return hash;
}

std::int64_t RoundHeader::to_steps(Duration d, std::int64_t low, std::int64_t high) const {
  // Four deadlines of at most 72 minutes times 16384 fit 64 bits; anything beyond is at a bound.
  const std::int64_t whole = deadline().count();
  const std::int64_t most = 4 * whole;
  const std::int64_t ns = std::clamp<std::int64_t>(d.count(), -most, most);
  const std::int64_t half = ns < 0 ? -whole / 2 : whole / 2;
  return std::clamp((ns * kDeadlineSteps + half) / whole, low, high);
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
  const auto guard = r.get<std::uint8_t>();
  h.level_used = r.get<std::uint8_t>();
  h.variant_used = r.get<std::uint8_t>();
  h.local_quality = r.get<std::uint8_t>();
  h.miss_price = r.get<std::uint16_t>();
  h.excess = r.get<std::int16_t>();
  h.computed = r.get<std::uint16_t>();
  for (std::uint16_t& e2e : h.e2e) e2e = r.get<std::uint16_t>();
  if (!r.ok() || version != kRoundHeaderVersion || (flags & ~kDegraded) != 0 || !indicator ||
      guard > static_cast<std::uint8_t>(GuardKind::kBudget) ||
      message_class > static_cast<std::uint8_t>(MessageClass::kResult)) {
    return std::nullopt;
  }
  h.degraded = (flags & kDegraded) != 0;
  h.message_class = static_cast<MessageClass>(message_class);
  h.indicator = *indicator;
  h.guard = static_cast<GuardKind>(guard);
  if (!consistent(h)) return std::nullopt;
  return h;
}

void write_round_header(std::span<std::byte, kRoundHeaderBytes> out, const RoundHeader& h) {
  assert(consistent(h));
  Writer w(out);
  w.put(kRoundHeaderVersion);
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
  w.put(static_cast<std::uint8_t>(h.guard));
  w.put(h.level_used);
  w.put(h.variant_used);
  w.put(h.local_quality);
  w.put(h.miss_price);
  w.put(h.excess);
  w.put(h.computed);
  for (const std::uint16_t e2e : h.e2e) w.put(e2e);
  assert(w.ok() && w.size() == kRoundHeaderBytes);
}

}  // namespace interneuron::wire
