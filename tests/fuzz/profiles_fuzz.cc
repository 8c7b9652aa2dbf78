// What users write of network conditions: a profile, a scenario, traces of delays and rates, and
// the settings of `testbed set`. The first byte says which; the rest is the text. Errors come as
// values that name the file, whatever the text is; what is accepted can be used for its purpose.
#include <string>
#include <vector>

#include "lab/emu/bottleneck.h"
#include "lab/emu/delay_trace.h"
#include "lab/emu/link_change.h"
#include "lab/emu/profile.h"
#include "lab/emu/scenario.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron;
using fuzz::require;

void require_message(const emu::ProfileError& error) {
  if (error.what.empty() || error.what.find('\n') != std::string::npos) {
    fuzz::finding("an error is not one line: '" + error.what + "'");
  }
}

// Traces that a profile may name: every name gives the same short ones.
std::variant<std::string, emu::FileError> load(const std::string& name) {
  if (name.ends_with(".rtt")) return "# Source: made up\n# step_s = 1\n20\n-1\n30\n";
  if (name.ends_with(".mahi")) return "1\n5\n9\n";
  return emu::FileError{"No such file or directory"};
}

void try_profile(std::string_view text) {
  const auto parsed = emu::parse_profile(text, "profile.toml", load);
  if (const auto* error = std::get_if<emu::ProfileError>(&parsed)) return require_message(*error);
  const auto& profile = std::get<emu::LinkProfile>(parsed);
  require(!profile.name.empty() && profile.name.size() <= 64, "a profile has no name");
}

void try_scenario(std::string_view text) {
  const auto parsed = emu::parse_scenario(text, "scenario.toml");
  if (const auto* error = std::get_if<emu::ProfileError>(&parsed)) return require_message(*error);
  const auto& scenario = std::get<emu::Scenario>(parsed);
  require(!scenario.links.empty() && scenario.links.size() <= emu::kMaxScenarioLinks &&
              scenario.cells.size() <= emu::kMaxScenarioCells,
          "a scenario has no links, or too many");
  for (const emu::ScenarioEvent& event : scenario.events) {
    require(!event.link || *event.link < scenario.links.size(), "an event has no link");
  }
}

void try_change(std::string_view text) {
  std::vector<std::string> settings;
  while (!text.empty() && settings.size() < 16) {
    const std::size_t end = text.find('\n');
    settings.emplace_back(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  const auto parsed = emu::parse_change(settings);
  if (const auto* error = std::get_if<emu::ProfileError>(&parsed)) require_message(*error);
}

void try_delays(std::string_view text) {
  const auto parsed = emu::parse_delay_trace(text);
  const auto* trace = std::get_if<emu::DelayTrace>(&parsed);
  if (trace == nullptr) return;
  require(trace->rtt_ms.size() >= 2 && trace->length() > Duration::zero(), "a trace is empty");
  for (const double share : {0.0, 0.3, 0.999, 1.7}) {
    const Duration at{
        static_cast<std::int64_t>(static_cast<double>(trace->length().count()) * share)};
    const emu::DelayTrace::Sample sample = trace->at(at);
    require(sample.out || (sample.rtt_ms >= 0 && sample.rtt_ms <= 60'000),
            "a delay is out of bounds");
  }
}

void try_rates(std::string_view text) {
  auto parsed = emu::parse_opportunities(text);
  auto* trace = std::get_if<emu::Opportunities>(&parsed);
  if (trace == nullptr) return;
  require(!trace->at_ms.empty() && trace->at_ms.back() > 0, "a trace is empty");
  emu::Bottleneck bottleneck(std::make_shared<const emu::Opportunities>(std::move(*trace)));
  Duration before{};
  for (int i = 0; i < 20; ++i) {
    const Duration left = bottleneck.departure(std::chrono::milliseconds(i), 1500);
    require(left >= before, "packets overtake each other in a bottleneck");
    bottleneck.send();
    before = left;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input({data, size});
  // Letters, so that seeds are files that people can read.
  switch (input.take<char>()) {
    case 'p':
      try_profile(input.text());
      break;
    case 's':
      try_scenario(input.text());
      break;
    case 'c':
      try_change(input.text());
      break;
    case 'd':
      try_delays(input.text());
      break;
    case 'r':
      try_rates(input.text());
      break;
    default:
      break;
  }
  return 0;
}
