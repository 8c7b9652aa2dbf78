// What the main functions of the project's programs share: the log, the options of every program,
// the way from arguments to a command, and one line with the documented exit code for whatever goes
// wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <functional>
#include <optional>
#include <span>
#include <string>

#include "interneuron/pcap_tap.h"

namespace interneuron::settings {

// A command of a sibling, which the program becomes when it is asked for it.
struct Elsewhere {
  const char* command;
  const char* program;
  const char* about;
};

struct Program {
  // Its name as it is installed, and a line that says what it is.
  const char* name;
  const char* about;
  // Adds the commands. Parsing sets `run` to what is to be done.
  void (*add_commands)(CLI::App& program, std::function<int()>& run);
  // The exit code of an exception of the program's own kinds, whose what() is one line for the
  // user; nothing for others. May be null.
  std::optional<int> (*code_of)(const std::exception& error) = nullptr;
  std::span<const Elsewhere> elsewhere = {};
};

// Captures what this process sends and receives (--pcap FILE of every command) while it lives; the
// destructor says on stderr what was captured. Thread-compatible.
class Capture {
 public:
  // Throws IoError.
  explicit Capture(std::string file);
  ~Capture();
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

 private:
  std::string file_;
  PcapTap tap_;
};

// Runs the command that the arguments name and returns the exit code. Called once, from main().
int run_program(const Program& program, int argc, char** argv);

}  // namespace interneuron::settings
