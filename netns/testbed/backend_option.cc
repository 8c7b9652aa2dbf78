#include "netns/testbed/backend_option.h"

#include <map>
#include <string>

namespace interneuron::netns {

void add_backend_option(CLI::App& command, Backend& backend) {
  std::map<std::string, Backend> names;
  for (const Backend known : {Backend::kAuto, Backend::kNetem, Backend::kEmulator}) {
    names[backend_name(known)] = known;
  }
  command
      .add_option_function<std::string>(
          "--backend", [&backend, names](const std::string& name) { backend = names.at(name); },
          "auto: tc-netem where the kernel has it and it can do the profiles; netem; emulator")
      ->default_str(backend_name(backend))
      ->check(CLI::IsMember({"auto", "netem", "emulator"}));
}

}  // namespace interneuron::netns
