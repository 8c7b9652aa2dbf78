#include "app/settings/capture.h"

#include <spdlog/spdlog.h>
#include <stdlib.h>

#include <filesystem>

#include "app/process/failure.h"
#include "interneuron/node_options.h"

namespace interneuron::settings {

namespace {

// The transport that was asked for of a command or of one below it; empty: none was.
std::string transport_of(const CLI::App& command) {
  const CLI::Option* option = command.get_option_no_throw("--transport");
  if (option != nullptr && option->count() > 0) return option->as<std::string>();
  for (const CLI::App* below : command.get_subcommands()) {
    if (std::string name = transport_of(*below); !name.empty()) return name;
  }
  return {};
}

}  // namespace

void add_capture_option(CLI::App& program, std::string& file) {
  program
      .add_option("--pcap", file,
                  "Any command: also write what it sends and receives to this file (libpcap; needs "
                  "CAP_NET_RAW)")
      ->envname(kPcapVariable)
      ->type_name("FILE");
  program.fallthrough();
}

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

}  // namespace interneuron::settings
