// The program `interneuron-lab`: testbed, demo, experiments and comparisons.
#include "app/offload/command.h"
#include "app/perception/input_error.h"
#include "app/process/failure.h"
#include "app/settings/program.h"
#include "lab/bench/command.h"
#include "lab/cli/commands.h"
#include "lab/eval_testbed/testbed_run.h"
#include "netns/state/error.h"

namespace interneuron::cli {
namespace {

// Vehicle and roadside unit as `eval --testbed` starts them: with an order file, by which they
// inject delays and record more. An empty group hides what nobody else calls.
template <class Hooks, class Made>
offload::MakeHooks<Hooks> hooks_of(const std::shared_ptr<std::string>& file) {
  return [file]() -> std::unique_ptr<Hooks> {
    if (file->empty()) return nullptr;
    return std::make_unique<Made>(eval_testbed::read_testbed_run(*file));
  };
}

void hide(CLI::App* command, const std::shared_ptr<std::string>& file) {
  command->group("");
  command->add_option("--testbed-run", *file, "What eval --testbed asks for")->group("");
}

void add_ends(CLI::App& program, std::function<int()>& run) {
  const auto vehicle = std::make_shared<std::string>();
  hide(offload::add_vehicle(program, run,
                            hooks_of<offload::VehicleHooks, eval_testbed::TestbedVehicle>(vehicle)),
       vehicle);
  const auto road = std::make_shared<std::string>();
  hide(offload::add_road(program, run,
                         hooks_of<offload::RoadHooks, eval_testbed::TestbedRoad>(road)),
       road);
}

void add_commands(CLI::App& program, std::function<int()>& run) {
  add_demo(program, run);
  add_testbed(program, run);
  add_eval(program, run);
  add_report(program, run);
  bench::add_bench(program, run);
  add_ends(program, run);
}

std::optional<int> code_of(const std::exception& error) {
  if (dynamic_cast<const perception::InputError*>(&error) != nullptr)
    return process::kConfiguration;
  if (const auto* testbed = dynamic_cast<const netns::TestbedError*>(&error)) {
    return testbed->exit_code;
  }
  return std::nullopt;
}

constexpr settings::Program kProgram{
    "interneuron-lab", "Interneuron: the testbed, the demo, experiments and comparisons",
    add_commands, code_of};

}  // namespace
}  // namespace interneuron::cli

int main(int argc, char** argv) {
  return interneuron::settings::run_program(interneuron::cli::kProgram, argc, argv);
}
