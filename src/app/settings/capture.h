// --pcap FILE: one option for all commands, also INTERNEURON_PCAP.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "interneuron/pcap_tap.h"

namespace interneuron::settings {

inline constexpr const char* kPcapVariable = "INTERNEURON_PCAP";

// Adds the option to the program; subcommands added later understand it, too.
void add_capture_option(CLI::App& program, std::string& file);

// Captures while it lives; the destructor says on stderr what was captured. Thread-compatible.
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

// Starts the capture for the command that was given; nullptr when this process is to capture
// nothing. Commands that start other programs open no sockets themselves: `testbed run` hands the
// variable on to the program inside, `demo` the option to its vehicle. Called when the
// configuration file has been applied. Throws Failure(2) where the command is to use a transport
// whose packets cannot be captured.
std::unique_ptr<Capture> start_capture(const CLI::App& program, const std::string& file);

}  // namespace interneuron::settings
