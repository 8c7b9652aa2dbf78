// What goes wrong with a testbed, as one line for its user.
#pragma once

#include <stdexcept>
#include <string>

namespace interneuron::netns {

// exit_code is what the program should exit with: 3 a bad profile, 5 a privilege is missing,
// 126/127 a command could not be run / was not found, 1 anything else.
class TestbedError : public std::runtime_error {
 public:
  TestbedError(int code, const std::string& what) : std::runtime_error(what), exit_code(code) {}
  int exit_code;
};

}  // namespace interneuron::netns
