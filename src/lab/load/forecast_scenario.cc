#include "lab/load/forecast.h"

#include <array>
#include <string_view>

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// How long runs under load and drives are. No measurement is behind the first: it holds the changes
// of load that a group has. A drive is long enough for each state of a profile (docs/constants.md).
constexpr Duration kLoadLength = 12s;
constexpr Duration kDriveLength = 120s;
// From half of what the bottleneck carries to three times as much.
constexpr std::array kLoads{0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2.0, 3.0};
// Messages of a drive, and their deadlines.
constexpr std::size_t kFrameBytes = std::size_t{32} * 1024;
constexpr Duration kDriveDeadline = 150ms;

constexpr std::array<std::string_view, 6> kUnderLoad{"rate", "size",  "vehicles",
                                                     "late", "cubic", "dip"};
struct Drive {
  std::string_view name;
  std::array<std::string_view, 2> profiles;
};
constexpr std::array<Drive, 10> kDrives{{{"4g", {"4g", ""}},
                                         {"5g", {"5g", ""}},
                                         {"4g-handover", {"4g-handover", ""}},
                                         {"5g-handover", {"5g-handover", ""}},
                                         {"4g-congestion", {"4g-congestion", ""}},
                                         {"lte-sprint-highway", {"lte-sprint-highway", ""}},
                                         {"lte-verizon-downtown", {"lte-verizon-downtown", ""}},
                                         {"generated-cellular", {"generated-cellular", ""}},
                                         {"wifi-roaming", {"wifi-roaming", ""}},
                                         {"4g+5g", {"4g", "5g"}}}};

std::vector<ForecastScenario> under_load(const std::string& name, std::uint64_t seed) {
  Choice choice;
  choice.peers = {Peer::kOurs, Peer::kOursVariants};
  choice.length = kLoadLength;
  choice.seed = seed;
  for (const Group& group : groups()) {
    if (group.name == name && group.takes_loads) choice.loads.assign(kLoads.begin(), kLoads.end());
  }
  std::vector<ForecastScenario> out;
  for (Scenario& s : scenarios(name, choice)) out.push_back({name, std::move(s), {}});
  return out;
}

std::vector<ForecastScenario> drive(const Drive& drive, std::uint64_t seed) {
  std::vector<ForecastScenario> out;
  for (const Peer peer : {Peer::kOurs, Peer::kOursVariants}) {
    Scenario s{.group = "driving",
               .name = drive.name,
               .peer = peer,
               .deadline = kDriveDeadline,
               .period = kCameraPeriod,
               .message_bytes = kFrameBytes};
    if (peer == Peer::kOursVariants) s.small_bytes = kFrameBytes / kSmallerVariant;
    s.length = kDriveLength;
    s.seed = seed;
    ForecastScenario f{std::string(drive.name), std::move(s), {}};
    for (const std::string_view profile : drive.profiles) {
      if (!profile.empty()) f.profiles.emplace_back(profile);
    }
    out.push_back(std::move(f));
  }
  return out;
}

}  // namespace

std::vector<std::string> forecast_names() {
  std::vector<std::string> out(kUnderLoad.begin(), kUnderLoad.end());
  for (const Drive& d : kDrives) out.emplace_back(d.name);
  return out;
}

std::vector<ForecastScenario> forecast_scenarios(const std::string& name, std::uint64_t seed) {
  for (const std::string_view load : kUnderLoad) {
    if (load == name) return under_load(name, seed);
  }
  for (const Drive& d : kDrives) {
    if (d.name == name) return drive(d, seed);
  }
  return {};
}

}  // namespace interneuron::load
