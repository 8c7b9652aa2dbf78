// How the program ends: documented exit codes, and the one exception that carries one.
#pragma once

#include <stdexcept>
#include <string>

namespace interneuron::process {

// Exit codes of the program; docs/programs.md lists them. kObjectiveMissed: the command worked, but
// the objective that it was given was missed. kCannotHere: this machine lacks what the command
// needs (tests count it as skipped).
inline constexpr int kFine = 0;
// What the command set out to do did not succeed.
inline constexpr int kFailed = 1;
// The command line is wrong: a command, an option or a name on it does not exist, or a value is out
// of range. Names are of policies, profiles, experiments, network cards, links and the hosts of a
// testbed.
inline constexpr int kUsage = 2;
// A file or folder that was named is missing, or what it says is wrong.
inline constexpr int kConfiguration = 3;
inline constexpr int kObjectiveMissed = 4;
inline constexpr int kPrivilege = 5;
inline constexpr int kCannotHere = 77;

// Ends the command with this exit code. what() is one line that names the thing and the remedy.
class Failure : public std::runtime_error {
 public:
  Failure(int code, const std::string& what) : std::runtime_error(what), code_(code) {}
  int code() const { return code_; }

 private:
  int code_;
};

}  // namespace interneuron::process
