#include "app/settings/program.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <stdlib.h>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <sstream>

#include "app/process/failure.h"
#include "app/process/sibling.h"
#include "app/process/whole_file.h"
#include "app/settings/command_line.h"
#include "app/settings/config_file.h"
#include "interneuron/node_options.h"
#include "interneuron/transport.h"
#include "node/io/nic.h"

namespace interneuron::settings {
namespace {

// Stands for --pcap FILE, the one option of every program.
constexpr const char* kPcapVariable = "INTERNEURON_PCAP";

// The transport that was asked for of a command or of one below it; empty: none was.
std::string transport_of(const CLI::App& command) {
  const CLI::Option* option = command.get_option_no_throw("--transport");
  if (option != nullptr && option->count() > 0) return option->as<std::string>();
  for (const CLI::App* below : command.get_subcommands()) {
    if (std::string name = transport_of(*below); !name.empty()) return name;
  }
  return {};
}

// Adds --pcap to the program; subcommands added later understand it, too.
void add_capture_option(CLI::App& program, std::string& file) {
  program
      .add_option("--pcap", file,
                  "Any command: also write what it sends and receives to this file (libpcap; needs "
                  "CAP_NET_RAW)")
      ->envname(kPcapVariable)
      ->type_name("FILE");
  program.fallthrough();
}

// Starts the capture for the command that was given; nullptr when this process is to capture
// nothing. Commands that start other programs open no sockets themselves: `testbed run` hands the
// variable on to the program inside, `demo` the option to its vehicle. Called when the
// configuration file has been applied. Throws Failure(2) where the command is to use a transport
// whose packets cannot be captured.
std::unique_ptr<Capture> start_capture(const CLI::App& program, const std::string& file) {
  // Programs that this one starts inherit the environment; each of them would write the same file.
  ::unsetenv(kPcapVariable);
  if (file.empty()) return nullptr;
  if (transport_of(program) == to_string(TransportKind::kXdp)) {
    throw process::Failure(
        process::kUsage,
        "--pcap cannot see what arrives over --transport xdp, which takes packets before "
        "the kernel could copy them; leave out one of the two, or use --transport ring or "
        "udp");
  }
  const auto given = [&program](const char* name) { return program.got_subcommand(name); };
  // These hand the file to the vehicle that they start.
  if (given("demo")) return nullptr;
  if (given("testbed")) {
    ::setenv(kPcapVariable, std::filesystem::absolute(file).c_str(), 1);
    return nullptr;
  }
  return std::make_unique<Capture>(file);
}

constexpr const char* kVersion = INTERNEURON_VERSION;

constexpr const char* kExitCodes =
    "Exit codes: 0 fine, 1 failed, 2 usage, 3 configuration or input, 4 deadline objective missed, "
    "5 needs a privilege, 77 this system cannot do it.";

bool is_command(const CLI::App& program, const std::string& name) {
  return !program.get_subcommands([&name](const CLI::App* c) { return c->get_name() == name; })
              .empty();
}

int tell(int code, const std::string& what) {
  std::fprintf(stderr, "interneuron: %s\n", what.c_str());
  return code;
}

// Vehicle and roadside unit often share a terminal, so each line says whose it is.
void name_log_lines(const CLI::App& program) {
  const std::string command = program.get_subcommands().front()->get_name();
  spdlog::set_pattern("%H:%M:%S.%e %^%l%$ " + command + ": %v");
}

// Names on the command line are usage, those of a configuration file are configuration. Asked
// before the file is applied: then options that only the file gives have no value yet.
int code_of_unknown_nic(const CLI::App& program) {
  const CLI::App* command = program.get_subcommands().front();
  const auto given = [command](const char* name) {
    const CLI::Option* option = command->get_option_no_throw(name);
    return option != nullptr && option->count() > 0;
  };
  return given("--config") && !given("--link") && !given("--nic") ? process::kConfiguration
                                                                  : process::kUsage;
}

// The first argument that is no option, and no value of --pcap, the one option of every program
// that has one.
std::string command_in(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--pcap") {
      ++i;
    } else if (argument.empty() || argument.front() != '-') {
      return argument;
    }
  }
  return "";
}

// The sibling reads all arguments, --help included. Here its commands are only told.
void go_elsewhere(CLI::App& app, const Program& program, int argc, char** argv) {
  const std::string wanted = command_in(argc, argv);
  for (const Elsewhere& other : program.elsewhere) {
    if (wanted == other.command) process::become_sibling(other.program, kVersion, argv);
    app.add_subcommand(other.command, other.about);
  }
}

int parse_and_run(const Program& program, int argc, char** argv) {
  process::refuse_other_version(kVersion);
  CLI::App app{program.about};
  app.footer(kExitCodes);
  app.require_subcommand(1);
  app.set_version_flag("--version", std::string(program.name) + " " + kVersion, "The version");
  std::function<int()> run;
  std::string pcap;
  add_capture_option(app, pcap);
  go_elsewhere(app, program, argc, argv);
  program.add_commands(app, run);
  const std::string first = argc > 1 ? argv[1] : "";
  if (!first.empty() && first.front() != '-' && !is_command(app, first)) {
    return tell(process::kUsage, unknown_command(app, first));
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help or the version, which go the way of all output, so that a failure is seen at the end.
    if (error.get_exit_code() == 0) {
      std::ostringstream text;
      const int code = app.exit(error, text, text);
      std::fputs(text.str().c_str(), stdout);
      return code;
    }
    return tell(process::kUsage, mistake_in(app, error));
  }
  name_log_lines(app);
  const int unknown_nic = code_of_unknown_nic(app);
  // Before the capture, which not every transport allows.
  apply_config(*app.get_subcommands().front());
  const auto capture = start_capture(app, pcap);
  try {
    return run();
  } catch (const io::UnknownNic& error) {
    return tell(unknown_nic, error.what());
  }
}

}  // namespace

Capture::Capture(std::string file) : file_(std::move(file)), tap_(file_) {}

Capture::~Capture() {
  const PcapTap::Counters counters = tap_.stop();
  std::string nics;
  for (const PcapTap::Counters::Nic& nic : counters.nics) {
    nics += (nics.empty() ? " (" : ", ") + nic.name + " " + std::to_string(nic.packets);
  }
  if (!nics.empty()) nics += ")";
  spdlog::info("captured {} packets in {}{}", counters.packets, file_, nics);
  if (!counters.problem.empty()) {
    spdlog::warn("{} lacks the end of what was sent: {}", file_, counters.problem);
  }
  if (counters.dropped > 0) {
    spdlog::warn("{} packets are missing in {}: the kernel dropped them", counters.dropped, file_);
  }
}

int run_program(const Program& program, int argc, char** argv) {
  auto log = spdlog::stderr_color_mt("interneuron");
  log->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(log);
  try {
    const int code = parse_and_run(program, argc, argv);
    // Whatever was printed is an answer only when all of it got out.
    process::finish_stdout();
    return code;
  } catch (const process::Failure& error) {
    return tell(error.code(), error.what());
  } catch (const IoError& error) {
    return tell(
        error.code() == EPERM || error.code() == EACCES ? process::kPrivilege : process::kFailed,
        error.what());
  } catch (const std::exception& error) {
    const auto code = program.code_of == nullptr ? std::nullopt : program.code_of(error);
    return tell(code.value_or(process::kFailed), error.what());
  }
}

}  // namespace interneuron::settings
