#include "core/rounds/round_terms.h"

#include <algorithm>

namespace interneuron {

QoS qos_of(const wire::RoundHeader& h) {
  const auto weight = [&h](std::size_t i) { return static_cast<double>(h.needs[i]) / 255.0; };
  return {h.deadline(), std::chrono::microseconds(h.period_us), h.message_class,
          Nature{weight(0), weight(1), weight(2), weight(3)}};
}

guard::RecentE2e recent_e2e(const wire::RoundHeader& header) {
  guard::RecentE2e out{};
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::uint16_t steps = header.e2e[i];
    if (steps == wire::kE2eNever) {
      out[i] = guard::kNever;
    } else if (steps != 0) {
      out[i] = header.from_steps(steps);
    }
  }
  return out;
}

guard::StageEnd stage_end(const wire::RoundHeader& header, std::size_t stage) {
  guard::StageEnd end;
  end.round = header.round.round;
  end.stage = stage;
  end.t0 = header.t0;
  end.x_permille = header.x_permille;
  end.deadline = header.deadline();
  end.variant = header.variant;
  end.best_planned = header.best_planned;
  end.degraded = header.degraded;
  end.is_computation = !header.is_communication(stage);
  end.terms = {header.guard, header.miss_price / 1000.0, header.local_quality / 255.0};
  return end;
}

guard::Spent spent_of(const wire::RoundHeader& h) {
  guard::Spent spent;
  if (h.level_used != wire::kNoneUsed) spent.level = h.level_used;
  if (h.variant_used == wire::kNoneUsed) return spent;
  spent.variant = h.variant_used;
  spent.computed = h.from_steps(h.computed);
  if (spent.level) spent.excess = h.from_steps(h.excess);
  return spent;
}

void note_level(wire::RoundHeader& h, const guard::LevelChoice& choice) {
  h.level_used = static_cast<std::uint8_t>(std::min<std::size_t>(choice.level, 254));
  h.excess = static_cast<std::int16_t>(
      h.to_steps(choice.excess.value_or(Duration::zero()), INT16_MIN, INT16_MAX));
}

void note_computed(wire::RoundHeader& h, Duration took) {
  h.variant_used = h.variant;
  h.computed =
      static_cast<std::uint16_t>(h.to_steps(h.from_steps(h.computed) + took, 0, UINT16_MAX));
}

}  // namespace interneuron
