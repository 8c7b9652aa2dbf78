// Runs systems for real: the programs `vehicle` and `road` in network namespaces, joined by
// emulated links, with real sockets, images and detection.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/eval_testbed/testbed_run.h"
#include "lab/eval/run.h"
#include "netns/testbed/testbed.h"
#include "perception/accuracy.h"

namespace interneuron::cli::eval {

// What one run left.
struct BenchRun {
  interneuron::eval::Run run;
  std::vector<perception::Shown> boxes;  // by round: what the application really got
};

class Bench {
 public:
  // `ladder`: as the programs' --ladder. `scratch`: a folder for what the programs read and write,
  // private to this bench. Throws netns::TestbedError where namespaces are forbidden.
  Bench(const interneuron::eval::Scenario& scenario, std::optional<std::filesystem::path> data,
        std::string ladder, std::filesystem::path scratch);

  // Rounds without injection, the best image over the primary link: calibrates the roadside's
  // ladder and the times that erdos_like freezes. Once, before run().
  void calibrate(std::uint32_t rounds);
  // As many rounds as the trace has. Throws Failure.
  BenchRun run(const interneuron::eval::System& system, const interneuron::eval::Trace& trace,
               std::uint64_t seed);

  // The roadside's ladder as calibrated, with the profile's accuracies.
  const interneuron::eval::Profile& profile() const { return profile_; }
  const interneuron::eval::ErdosTimes& erdos() const { return erdos_; }
  const std::string& ladder() const { return ladder_; }

 private:
  BenchRun start(const TestbedRun& orders, std::uint32_t rounds);
  void start_programs(const TestbedRun& orders, std::uint32_t rounds);
  std::vector<std::string> road_command() const;
  std::vector<std::string> vehicle_command(const interneuron::eval::System& system,
                                           std::uint32_t rounds) const;
  BenchRun collect(const TestbedRun& orders) const;

  const interneuron::eval::Scenario& scenario_;
  std::optional<std::filesystem::path> data_;
  std::string kind_;  // of the ladder
  std::filesystem::path scratch_;
  std::string video_;
  netns::Testbed testbed_;
  interneuron::eval::Profile profile_;
  interneuron::eval::ErdosTimes erdos_;
  std::string ladder_;
};

// Run times of the levels in operation, without what was injected: measured where a level ran often
// enough to tell, else as calibrated.
interneuron::eval::Profile measured(const interneuron::eval::Profile& calibrated,
                                    const std::vector<std::vector<BenchRun>>& runs);

}  // namespace interneuron::cli::eval
