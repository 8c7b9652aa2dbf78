// The exception of everything that makes, finds or changes a testbed. Its text is one line for the
// user: what could not be done, why, and where possible the remedy.
#pragma once

#include <stdexcept>
#include <string>

namespace interneuron::netns {

// exit_code is what the program should exit with: 2 a name or number that the user gave does not
// exist or is out of range, 3 a file is missing or wrong, 5 a privilege is missing, 126 or 127 a
// command could not be run or was not found, 1 anything else.
class TestbedError : public std::runtime_error {
 public:
  TestbedError(int code, const std::string& what) : std::runtime_error(what), exit_code(code) {}
  int exit_code;
};

}  // namespace interneuron::netns
