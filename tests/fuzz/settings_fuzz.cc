// What users set: the options of links on the command line, peers' addresses, patterns of network
// cards, and the configuration file. The first byte says which; the rest is the text. The only
// exception is Failure, with one line and an exit code of the documented ones.
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "app/process/failure.h"
#include "app/settings/config_file.h"
#include "app/settings/link_options.h"
#include "node/io/nic_choice.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"
#include "tests/fuzz/scratch_folder.h"

namespace {

using namespace interneuron;
using fuzz::require;

void require_one_line(const process::Failure& failure) {
  const std::string_view what = failure.what();
  if (what.empty() || what.find('\n') != std::string_view::npos) {
    fuzz::finding("a failure is not one line: '" + std::string(what) + "'");
  }
}

void try_link(const std::string& text, settings::LinkPeer peer) {
  try {
    const settings::LinkOption link = settings::parse_link_option(text, peer);
    require(!link.nic.empty(), "a link has no card");
    require(settings::parse_link_option(settings::to_string(link), peer) == link,
            "a link has changed by being written and read");
    NodeOptions options;
    settings::append_links({text}, peer, options);
    require(options.links.size() + options.rules.size() == 1, "a link is lost");
  } catch (const process::Failure& failure) {
    require_one_line(failure);
    require(failure.code() == process::kUsage, "a wrong option has another exit code");
  }
}

void try_address(const std::string& text) {
  if (const auto address = parse_address(text)) {
    const auto again = parse_address(to_string(*address));
    require(again && *again == *address, "an address has changed by being written and read");
    require(is_ipv6(*address) || !to_string(*address).starts_with('['), "a family is wrong");
    is_private(*address);
  }
  static_cast<void>(io::nic_pattern_error(text));
}

// A command with an option of each kind that the programs have.
void try_config(std::string_view text) {
  static const fuzz::ScratchFolder folder;
  CLI::App command("of the fuzzer", "vehicle");
  std::string name;
  double deadline = 0;
  int level = 0;
  bool flag = false;
  std::vector<std::string> links;
  std::string transport = "auto";
  command.add_option("--data-folder", name);
  command.add_option("--deadline-ms", deadline)->check(CLI::Range(1.0, 60'000.0));
  command.add_option("--max-level", level);
  command.add_flag("--loop", flag);
  settings::add_link_option(command, "--link", links, settings::LinkPeer::kNamed);
  settings::add_transport_option(command, transport);
  settings::add_config_option(command);
  const std::string file = folder.write("config.toml", text).string();
  try {
    command.parse(std::vector<std::string>{file, "--config"});
    settings::apply_config(command);
    for (const std::string& link : links)
      settings::parse_link_option(link, settings::LinkPeer::kNamed);
    require(deadline == 0 || (deadline >= 1 && deadline <= 60'000), "a range was not checked");
  } catch (const process::Failure& failure) {
    require_one_line(failure);
    require(failure.code() == process::kConfiguration, "a wrong file has another exit code");
    require(std::string_view(failure.what()).starts_with(file), "a failure does not name the file");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input({data, size});
  // Letters, so that seeds are files that people can read.
  switch (input.take<char>()) {
    case 'l':
      try_link(std::string(input.text()), settings::LinkPeer::kNamed);
      break;
    case 'n':
      try_link(std::string(input.text()), settings::LinkPeer::kNone);
      break;
    case 'a':
      try_address(std::string(input.text()));
      break;
    case 'c':
      try_config(input.text());
      break;
    default:
      break;
  }
  return 0;
}
