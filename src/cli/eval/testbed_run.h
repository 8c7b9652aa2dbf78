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

#include "cli/run_files.h"
#include "eval/erdos.h"
#include "eval/run.h"
#include "eval/system.h"
#include "eval/trace.h"
#include "interneuron/node.h"

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

// The vehicle's part. Thread-compatible.
class TestbedVehicle {
 public:
  explicit TestbedVehicle(TestbedRun run) : run_(std::move(run)) {}

  const interneuron::eval::System& system() const { return run_.system; }
  void configure(PipelineConfig& pipeline) const;
  void configure(NodeOptions& node) const;  // injects into the uplink
  // Those that the system submits.
  Variants submitted(Variants variants) const;
  void done(const RoundDone& event, const RoundRow& row);
  void write(const std::vector<Statistics::Link>& links) const;

 private:
  TestbedRun run_;
  Json rounds_ = Json::array();
};

std::optional<TestbedVehicle> testbed_vehicle(const std::string& file);  // nothing: no file

// The roadside's part. Thread-compatible, but inside_compute() may be asked by any thread.
class TestbedRoad {
 public:
  explicit TestbedRoad(TestbedRun run) : run_(std::move(run)) {}

  const std::vector<LevelProfile>& levels() const { return run_.levels; }
  void configure(NodeOptions& node) const;  // injects into the downlink
  Duration before_compute(RoundId round) const;
  Duration inside_compute(RoundId round) const;
  // The level of systems that do not ask the guard; nothing: ask it.
  std::optional<std::size_t> level(std::span<const LevelProfile> levels, TimePoint delivered,
                                   TimePoint now) const;
  struct Computed {
    RoundId round{};
    std::uint8_t variant = 0;
    std::size_t level = 0;
    bool degraded = false;
    TimePoint delivered{};
    TimePoint began{};
    TimePoint ended{};
  };
  void computed(const Computed& computed);
  void write(const std::string& ladder, const std::vector<std::string>& names,
             std::span<const LevelProfile> levels) const;

 private:
  TestbedRun run_;
  Json rounds_ = Json::array();
};

std::optional<TestbedRoad> testbed_road(const std::string& file);

}  // namespace interneuron::cli::eval
