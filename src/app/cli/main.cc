// The program `interneuron`: what anybody who has links needs, and the door to its siblings.
#include <array>
#include <cstdio>

#include "app/cli/commands.h"
#include "app/process/failure.h"
#include "app/settings/program.h"

namespace interneuron::cli {
namespace {

constexpr std::array<settings::Elsewhere, 7> kElsewhere{{
    {"vehicle", "interneuron-offload",
     "Send camera frames through the pipeline; one answer per round"},
    {"road", "interneuron-offload",
     "A roadside unit: detects in the images of any vehicle that comes"},
    {"demo", "interneuron-lab",
     "A vehicle and a roadside unit over two emulated modems, on this machine"},
    {"testbed", "interneuron-lab",
     "Vehicles and roadside units on this machine, joined by emulated modems"},
    {"eval", "interneuron-lab",
     "The paper's experiments and more, ours beside baselines and bounds"},
    {"report", "interneuron-lab",
     "One self-contained HTML page of an evaluation's folder, every figure as SVG and PNG"},
    {"bench", "interneuron-lab", "Measures Interneuron beside other transports"},
}};

void add_commands(CLI::App& program, std::function<int()>& run) {
  add_keys(program, run);
  add_links(program, run);
  add_top(program, run);
  add_doctor(program, run);
  add_probe(program, run);
  program.add_subcommand("version", "The version")->callback([&run] {
    run = [] {
      std::printf("interneuron %s\n", INTERNEURON_VERSION);
      return process::kFine;
    };
  });
}

constexpr settings::Program kProgram{
    "interneuron", "Interneuron: deadline-bound messages over several network cards at once",
    add_commands, nullptr, kElsewhere};

}  // namespace
}  // namespace interneuron::cli

int main(int argc, char** argv) {
  return interneuron::settings::run_program(interneuron::cli::kProgram, argc, argv);
}
