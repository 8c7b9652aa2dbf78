// measure_wakes() of session.h.
#include <fmt/format.h>
#include <signal.h>

#include <algorithm>

#include "netns/testbed/testbed.h"
#include "netns/verify/session.h"
#include "netns/verify/tools.h"

namespace interneuron::netns::verify {

void measure_wakes(const State& state, const SessionOptions& options, Direction d,
                   const process::PrivateFolder& folder, const std::function<void(Duration)>& wait,
                   std::vector<LinkEvidence>& evidence) {
  const auto direction = [&](std::size_t slot) -> DirectionEvidence& {
    return evidence[slot].directions[static_cast<std::size_t>(d)];
  };
  std::vector<std::size_t> slots;
  Duration silence{};
  for (std::size_t slot = 0; slot < evidence.size(); ++slot) {
    const emu::DirectionParams carrier = Testbed::carrier(state, options.links[slot], d);
    if (carrier.wake_by <= Duration{}) continue;
    if (carrier.wake_after > kLongestSilence) {
      direction(slot).not_woken =
          fmt::format("it sleeps after {:.0f} s only", to_seconds(carrier.wake_after));
      continue;
    }
    slots.push_back(slot);
    silence = std::max(silence, carrier.wake_after);
  }
  if (slots.empty()) return;
  wait(silence + kSilenceMargin);
  std::vector<Process> pings;
  for (const std::size_t slot : slots) {
    const TestbedLink& link = state.links[options.links[slot]];
    const bool up = d == Direction::kUp;
    pings.emplace_back(state, up ? vehicle_of(link) : kRoad, two_pings(link, d), folder,
                       fmt::format("wake-{}-{}", up ? "up" : "down", slot));
  }
  wait(kTwoPings);
  for (std::size_t i = 0; i < slots.size(); ++i) {
    pings[i].end(SIGINT);
    const PingLog log = parse_ping(pings[i].output());
    DirectionEvidence& e = direction(slots[i]);
    if (log.answered.size() == 2) {
      e.woke_after = log.answered[0].round_trip - log.answered[1].round_trip;
    } else {
      e.not_woken = "the pings had no answers";
    }
  }
}

}  // namespace interneuron::netns::verify
