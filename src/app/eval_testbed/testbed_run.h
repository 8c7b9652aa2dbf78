// One run of one system on the testbed, as `eval --testbed` tells it to the programs `vehicle` and
// `road` by their option --testbed-run FILE, which no help shows. Each leaves its record beside
// that file: vehicle.json and road.json.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/offload/hooks.h"
#include "interneuron/node.h"
#include "lab/eval/erdos.h"
#include "lab/eval/run.h"
#include "lab/eval/system.h"
#include "lab/eval/trace.h"
#include "lab/files/run_files.h"

namespace interneuron::cli::eval {

struct TestbedRun {
  interneuron::eval::System system;
  std::vector<interneuron::eval::Injected> injected;  // by round; further rounds have none
  interneuron::eval::ErdosTimes erdos;                // for LevelRule::kErdos
  std::vector<LevelProfile> levels;  // of the roadside's ladder; empty: it calibrates
  FallbackQuality fallback;
  std::filesystem::path file;  // where it was read from

  // What is injected into this module of the round.
  Duration in(interneuron::eval::Module module, RoundId round) const;
};

// Throw Failure (1, 3) naming the file.
void write_testbed_run(const std::filesystem::path& file, const TestbedRun& run);
TestbedRun read_testbed_run(const std::filesystem::path& file);

// The roadside's levels in its record; quality by rank where the ladder knows none.
std::vector<LevelProfile> levels_of(const Json& levels);

// The hooks of the vehicle. Thread-compatible.
class TestbedVehicle : public VehicleHooks {
 public:
  explicit TestbedVehicle(TestbedRun run) : run_(std::move(run)) {}

  void configure(PipelineConfig& pipeline) const override;
  void configure(NodeOptions& node) const override;  // injects into the uplink
  // Those that the system submits.
  Variants submitted(Variants variants) const override;
  bool local_backup() const override { return run_.system.local_backup; }
  void done(const RoundDone& event, const RoundRow& row) override;
  // Leaves vehicle.json.
  void finished(const std::vector<Statistics::Link>& links) override;

 private:
  TestbedRun run_;
  Json rounds_ = Json::array();
};

// The hooks of the roadside unit. Thread-compatible, but inside_compute() may be asked by any
// thread.
class TestbedRoad : public RoadHooks {
 public:
  explicit TestbedRoad(TestbedRun run) : run_(std::move(run)) {}

  void configure(NodeOptions& node) const override;  // injects into the downlink
  std::span<const LevelProfile> levels() const override { return run_.levels; }
  Duration before_compute(RoundId round) const override;
  Duration inside_compute(RoundId round) const override;
  // The level of systems that do not ask the guard.
  std::optional<std::size_t> level(std::span<const LevelProfile> levels, TimePoint delivered,
                                   TimePoint now) const override;
  void computed(const offload::Computed& computed) override;
  // Leaves road.json.
  void finished(const std::string& ladder, const std::vector<std::string>& names,
                std::span<const LevelProfile> levels) override;

 private:
  TestbedRun run_;
  Json rounds_ = Json::array();
};

}  // namespace interneuron::cli::eval
