// The exception of everything that makes, finds or changes a testbed. Its text is one line for the
// user: what could not be done, why, and where possible the remedy.
#pragma once

#include <stdexcept>
#include <string>

namespace interneuron::netns {

// exit_code is what the program should end with: 2 a name that is none of a host, 3 a bad profile
// or setting, 5 a missing privilege, 126 a command that could not be run, 127 one that was not
// found, 1 anything else.
class TestbedError : public std::runtime_error {
 public:
  TestbedError(int code, const std::string& what) : std::runtime_error(what), exit_code(code) {}
  int exit_code;
};

}  // namespace interneuron::netns
