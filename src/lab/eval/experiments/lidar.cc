// table-lidar: the systems on a pipeline of point clouds instead of images.
#include <fmt/format.h>

#include "lab/eval/experiments/compare.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/scorer.h"

namespace interneuron::experiments {
namespace {

using eval::LidarSweep;

struct LidarCase {
  const char* name;
  const char* title;
  // Changes the scenario of the uniform law.
  void (*change)(eval::Scenario& scenario);
};
constexpr LidarCase kLidarCases[] = {
    {"uniform", "uniform law", [](eval::Scenario&) {}},
    {"per-nic", "delays of one network", [](eval::Scenario& s) { s.law = eval::per_nic_law(); }},
    {"driving", "driving at 50 km/h over 5G and 4G", [](eval::Scenario& s) {
       s.law.shape = eval::DelayLaw::Shape::kNone;
       s.links = {*emu::built_in_profile("5g"), *emu::built_in_profile("4g")};
     }}};

constexpr std::pair<LidarSweep, const char*> kSweeps[] = {{LidarSweep::kKitti, "KITTI"},
                                                          {LidarSweep::kNuScenes, "nuScenes"}};

constexpr const char* kLidarSystems[] = {"ours", "paper", "b0", "erdos_like", "erdos_e2e"};

std::vector<eval::System> systems_for(const eval::Scenario& scenario) {
  std::vector<eval::System> out = some_systems(kLidarSystems);
  eval::System joint = out.front();
  joint.name = "ours_joint";
  joint.about = "ours with the policy joint and all variants";
  joint.policy = "joint";
  joint.whole_ladder = true;
  out.insert(out.begin() + 1, std::move(joint));
  for (std::size_t i = 0; i < scenario.profile.variants.size(); ++i) {
    eval::System fixed = *eval::find_system("always_sampled");
    fixed.name = "always_" + scenario.profile.variants[i].name;
    fixed.about = fmt::format(
        "the sweep as {} over every link that can carry it, highest level, local backup",
        scenario.profile.variants[i].name);
    fixed.only_variant = static_cast<std::uint8_t>(i);
    out.push_back(std::move(fixed));
  }
  if (eval::is_known_to_causal(scenario)) out.push_back(*eval::find_system("causal_player"));
  return out;
}

std::vector<Column> columns() {
  std::vector<Column> out = system_columns();
  std::erase_if(out, [](const Column& c) { return c.key.ends_with("ap") || c.key == "/ar"; });
  out.insert(out.end() - 2, {{"/agreement", "agreement on time", 4},
                             {"/effective_agreement", "effective agreement", 4}});
  return out;
}

}  // namespace

void run_table_lidar(const Request& request, Document& document) {
  for (const auto& [sweep, title] : kSweeps) {
    const CloudScorer scorer(request.data, sweep, request.rounds, request.progress);
    const Scoring score = [&scorer](SystemRow& row, const std::vector<ShownRound>& every,
                                    const std::vector<ShownRound>& on_time) {
      row.agreement = {scorer.agreement(on_time), scorer.agreement(every)};
    };
    for (const LidarCase& c : kLidarCases) {
      eval::Scenario scenario = eval::lidar_scenario(sweep);
      c.change(scenario);
      const std::string name = fmt::format("{}-{}", to_string(sweep), c.name);
      const Compared compared =
          compare(request, "table-lidar " + name, scenario, systems_for(scenario));
      document.tables.push_back({name, fmt::format("{} sweep, {}", title, c.title),
                                 describe(scenario), columns(),
                                 system_rows(request, compared, score)});
    }
    if (!scorer.missing().empty()) {
      document.notes.push_back(fmt::format("Agreement is not known: {}.", scorer.missing()));
    }
  }
  document.notes.push_back(
      "Agreement and quality: with the clusters that the best level finds on the whole sweep, "
      "which nobody has labelled; no accuracy. The sweeps are one recorded sweep of each data set, "
      "moved by a synthetic ego-motion (docs/evaluation.md, The lidar pipeline).");
}

}  // namespace interneuron::experiments
