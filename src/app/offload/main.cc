// The program `interneuron-offload`: vehicle and roadside unit of the camera pipeline.
#include "app/offload/command.h"
#include "app/perception/input_error.h"
#include "app/process/failure.h"
#include "app/settings/program.h"

namespace interneuron::offload {
namespace {

void add_commands(CLI::App& program, std::function<int()>& run) {
  add_vehicle(program, run);
  add_road(program, run);
}

std::optional<int> code_of(const std::exception& error) {
  if (dynamic_cast<const perception::InputError*>(&error) != nullptr)
    return process::kConfiguration;
  return std::nullopt;
}

constexpr settings::Program kProgram{
    "interneuron-offload", "Interneuron: a camera's frames computed at the roadside, by a deadline",
    add_commands, code_of};

}  // namespace
}  // namespace interneuron::offload

int main(int argc, char** argv) {
  return interneuron::settings::run_program(interneuron::offload::kProgram, argc, argv);
}
