// Runs a program as a filter: it reads what we give it and we get what it prints. Both lie in files
// without names in memory, so that neither waits for the other and nothing is left anywhere. Its
// messages go to our stderr. Thread-compatible.
#pragma once

#include <string>
#include <vector>

namespace interneuron::process {

struct Filtered {
  // The errno with which it could not be started; 0: it ran.
  int start_error = 0;
  // Its exit code, or 128 and the number of the signal that ended it.
  int code = 0;
  std::string output;
};

// The first of `command` is looked for in PATH. Throws Failure (1) when there is no memory or no
// descriptor for it.
Filtered filter(const std::string& input, std::vector<std::string> command);

}  // namespace interneuron::process
