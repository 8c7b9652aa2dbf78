#include "lab/emu/scenario_player.h"

#include <algorithm>
#include <utility>

#include "lab/emu/delay_process.h"

namespace interneuron::emu {

namespace {

// Numbers from which the seeds of two random streams are derived, the letters "fade" and "hole", so
// that these streams differ from those of the links.
constexpr std::uint64_t kFadingStream = 0x66616465;
constexpr std::uint64_t kHoleStream = 0x686f6c65;

// Holes are told to the links this long before they begin, so that packets that will leave a queue
// within one are lost at once.
constexpr Duration kAhead = LinkModel::kLongestWait;

Duration exponential(RandomStream& stream, Duration mean) {
  return Duration{static_cast<std::int64_t>(stream.exponential(static_cast<double>(mean.count())))};
}

}  // namespace

ScenarioPlayer::ScenarioPlayer(Scenario scenario)
    : scenario_(std::move(scenario)), hole_stream_(split_mix(scenario_.seed ^ kHoleStream)) {
  std::vector<std::shared_ptr<DelayProcess>> processes;
  for (const ScenarioLink& link : scenario_.links) {
    links_.push_back(std::make_unique<Link>(link.profile, link.seed));
    processes.push_back(links_.back()->process());
  }
  couple(processes, scenario_.common_fading, split_mix(scenario_.seed ^ kFadingStream));
  // Outages without changes can be told at once: packets in a queue then meet them exactly.
  for (const ScenarioEvent& event : scenario_.events) {
    if (event.outage <= Duration{}) continue;
    for (std::size_t i = 0; i < links_.size(); ++i) {
      if (event.link.value_or(i) == i) links_[i]->outage(event.at, event.outage);
    }
  }
  if (scenario_.holes.mean_gap > Duration{}) {
    hole_from_ = exponential(hole_stream_, scenario_.holes.mean_gap);
  }
  play(Duration{});
}

void ScenarioPlayer::play(Duration now) {
  announce_holes(now + kAhead);
  const std::vector<ScenarioEvent>& events = scenario_.events;
  for (; next_event_ < events.size() && events[next_event_].at <= now; ++next_event_) {
    const ScenarioEvent& event = events[next_event_];
    for (std::size_t i = 0; i < links_.size(); ++i) {
      if (event.link.value_or(i) == i) links_[i]->change(event.at, event.change);
    }
  }
}

std::optional<Duration> ScenarioPlayer::next() const {
  Duration next = Duration::max();
  if (next_event_ < scenario_.events.size()) next = scenario_.events[next_event_].at;
  if (hole_from_ != Duration::max()) next = std::min(next, hole_from_ - kAhead);
  if (next == Duration::max()) return std::nullopt;
  return next;
}

void ScenarioPlayer::announce_holes(Duration until) {
  while (hole_from_ <= until) {
    const Duration length = exponential(hole_stream_, scenario_.holes.mean_length);
    for (const auto& link : links_) link->outage(hole_from_, length);
    hole_from_ += length + exponential(hole_stream_, scenario_.holes.mean_gap);
  }
}

}  // namespace interneuron::emu
