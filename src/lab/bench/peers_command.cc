#include "lab/bench/command.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "app/process/whole_file.h"
#include "app/settings/link_options.h"
#include "interneuron/message.h"
#include "lab/bench/reports.h"
#include "lab/peers_testbed/comparison.h"

namespace interneuron::bench {
namespace {

// Bytes of a message: at least one that holds its own head and has a quarter that does.
constexpr std::size_t kLeastBytes = 64;
// Milliseconds; wide, they catch slips of pen.
constexpr double kLeastDeadline = 1;
constexpr double kMostDeadline = 60'000;
constexpr std::size_t kMostPeersMessages = 100'000;
// Seconds; wide, too.
constexpr double kLeastPeersSeconds = 1;
constexpr double kMostPeersSeconds = 86'400;

struct PeersOptions {
  std::vector<std::string> scenarios;
  std::vector<std::string> peers;
  std::vector<std::size_t> sizes;
  std::vector<double> deadlines;
  std::size_t messages = 100;
  std::optional<double> seconds{};
  std::uint64_t seed = 1;
  std::string transport = "auto";
  bool quick = false;
  bool json = false;
  std::string plot;
  std::string page;
};

template <class T>
std::vector<std::string> option_names(std::span<const T> all) {
  std::vector<std::string> out;
  for (const T& one : all) out.emplace_back(one.name);
  return out;
}

peers_testbed::Choice choice_of(const PeersOptions& o) {
  peers_testbed::Choice choice;
  for (const std::string& name : o.scenarios)
    choice.scenarios.push_back(peers_testbed::scenario_of(name));
  for (const std::string& name : o.peers) choice.peers.push_back(peers_testbed::peer_of(name));
  choice.sizes = o.sizes;
  for (const double ms : o.deadlines) choice.deadlines.push_back(from_ms(ms));
  choice.messages = o.messages;
  if (o.seconds) choice.length = from_ms(1e3 * *o.seconds);
  choice.seed = o.seed;
  return choice;
}

void write_page(const std::string& file, const std::vector<peers_testbed::Row>& rows) {
  process::write_whole(file, peers_testbed::page_of(rows));
}

int run_peers(const PeersOptions& o) {
  require_picture(o.plot);
  // A run takes too long to find out at its end.
  for (const std::string& file : {o.plot, o.page}) {
    const std::filesystem::path folder = std::filesystem::path(file).parent_path();
    if (folder.empty() || std::filesystem::is_directory(folder)) continue;
    throw process::Failure(process::kConfiguration,
                           "'" + file + "': there is no folder '" + folder.string() + "'");
  }
  const process::SignalWatch signals;
  const TransportKind datagrams = settings::transport_kind(o.transport);
  std::vector<peers_testbed::Run> runs =
      o.quick ? peers_testbed::quick_runs(o.seed) : peers_testbed::runs_of(choice_of(o));
  for (peers_testbed::Run& run : runs) run.datagrams = datagrams;
  const peers_testbed::Compared compared = peers_testbed::compare(runs);
  if (o.json) {
    fmt::print("{}\n", peers_json(compared, datagrams).dump(2));
  } else {
    print_peers(compared, datagrams);
  }
  // What took so long to measure is shown, but takes the place of no page of a whole series.
  if (compared.ended) std::rethrow_exception(compared.ended);
  if (!o.page.empty()) write_page(o.page, compared.rows);
  if (!o.plot.empty()) plot_peers(o.plot, compared.rows);
  if (o.json) return process::kFine;
  for (const std::string& file : {o.plot, o.page}) {
    if (!file.empty()) fmt::print("\nwritten to {}\n", file);
  }
  return process::kFine;
}

std::string footer() {
  std::string out = "Scenarios:\n";
  for (const peers_testbed::Scenario& s : peers_testbed::all_scenarios()) {
    out += fmt::format("  {:18} {}\n", s.name, s.about);
  }
  out += "Peers:\n";
  for (const peers_testbed::Peer& p : peers_testbed::all_peers())
    out += fmt::format("  {:18} {}\n", p.name, p.about);
  return out +
         "Examples:\n  interneuron bench peers --quick --json --plot peers.svg > peers.json\n  "
         "interneuron bench peers "
         "clean loss hole --size 128KiB --messages 600\n"
         "  interneuron bench peers hole --peer ours_duplicate,mptcp --deadline 100\n"
         "  interneuron bench peers drive-5g-4g --json > peers.json\n"
         "  interneuron bench peers clean loss --size 5KB,128KiB --plot peers.svg";
}

}  // namespace

void add_peers(CLI::App& bench, std::function<int()>& run) {
  auto o = std::make_shared<PeersOptions>();
  CLI::App* c = bench.add_subcommand(
      "peers", "Misses, bytes and processor time beside UDP, TCP, MPTCP and more, on the testbed");
  CLI::Option* quick = c->add_flag("--quick", o->quick, "A selection of everything, in 25 minutes");
  CLI::Option* scenarios =
      c->add_option("SCENARIO", o->scenarios, "Under which conditions (default: all)")
          ->check(CLI::IsMember(option_names(peers_testbed::all_scenarios())));
  quick->excludes(scenarios);
  const auto list = [c](const char* name, auto& into, const char* about) {
    return c->add_option(name, into, about)->delimiter(',')->take_all()->allow_extra_args(false);
  };
  quick->excludes(
      list("--peer", o->peers, "What is compared; once per peer, or with commas (default: all)")
          ->check(CLI::IsMember(option_names(peers_testbed::all_peers()))));
  quick->excludes(
      list("--size", o->sizes, "Bytes of a message, or 5KB, 128KiB (default: 5KB, 128KiB, 1MB)")
          ->transform(CLI::AsSizeValue(true))
          ->check(CLI::Range(kLeastBytes, kMaxMessageBytes)));
  quick->excludes(list("--deadline", o->deadlines, "Milliseconds (default: 100, 150, 300)")
                      ->check(CLI::Range(kLeastDeadline, kMostDeadline)));
  CLI::Option* messages = c->add_option("--messages", o->messages, "How many, of each run")
                              ->capture_default_str()
                              ->check(CLI::Range(std::size_t{1}, kMostPeersMessages));
  CLI::Option* seconds =
      c->add_option("--seconds", o->seconds, "How long each run sends, in place of --messages")
          ->check(CLI::Range(kLeastPeersSeconds, kMostPeersSeconds));
  quick->excludes(messages)->excludes(seconds);
  seconds->excludes(messages);
  settings::add_transport_option(*c, o->transport);
  c->add_option("--seed", o->seed, "Seed of the links")->capture_default_str();
  c->add_flag("--json", o->json, "The rows as JSON on stdout (docs/schema/peers.json)");
  c->add_option("--plot", o->plot, "Draws misses and bytes of every peer, .svg or .png");
  c->add_option("--page", o->page, "Writes the rows to a file as tables of Markdown");
  c->footer(footer());
  c->callback([&run, o] { run = [o] { return run_peers(*o); }; });
}

}  // namespace interneuron::bench
