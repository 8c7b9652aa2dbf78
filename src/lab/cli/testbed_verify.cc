#include "lab/cli/testbed_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "netns/state/hosts.h"
#include "netns/state/state.h"
#include "netns/testbed/testbed.h"
#include "netns/verify/assess.h"
#include "netns/verify/session.h"
#include "netns/verify/tools.h"

namespace interneuron::cli {
namespace {

namespace verify = netns::verify;
using netns::Testbed;

// Seconds. Rates take 13 s of it for two links; the testbed remembers its schedule for 82 s
// (SharedLink::kSteps), less what passes until it is read.
constexpr int kShortest = 20;
constexpr int kLongest = 80;

struct LinkCheckOptions {
  std::string name = "default";
  std::vector<std::string> links;
  int seconds = 57;
  bool json = false;
};

// Each link once, in the order of the testbed.
std::vector<std::size_t> selected(const netns::State& state, std::vector<std::string> which) {
  if (which.empty()) which.emplace_back("vehicle1/*");
  std::vector<std::size_t> out;
  for (const std::string& name : which) {
    const auto indices = Testbed::select(state, name);
    out.insert(out.end(), indices.begin(), indices.end());
  }
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

int exit_code(verify::Verdict verdict) {
  if (verdict == verify::Verdict::kFailed) return process::kFailed;
  return verdict == verify::Verdict::kInconclusive ? process::kCannotHere : process::kFine;
}

int run_verify(const LinkCheckOptions& o) {
  const netns::State state = found_testbed(o.name);
  verify::require_tools({{"ping", "iputils-ping"}, {"iperf3", "iperf3"}, {"tcpdump", "tcpdump"}});
  if (state.user_ns_fd >= 0) verify::allow_setgroups();
  verify::SessionOptions session{.links = selected(state, o.links),
                                 .length = std::chrono::seconds(o.seconds)};
  const process::SignalWatch signals;
  constexpr Duration kBetweenLines = std::chrono::seconds(2);
  Duration next{};
  const auto evidence = verify::measure(state, session, [&](Duration elapsed) {
    if (elapsed < next) return;
    next = elapsed + kBetweenLines;
    fmt::print(stderr, "verify: {:.0f} of {} s\n", to_seconds(elapsed), o.seconds);
  });
  verify::Findings findings;
  findings.testbed = state.name;
  findings.seed = state.seed;
  findings.backend = netns::backend_name(state.backend);
  findings.disturbance = evidence.front().disturbance;
  for (std::size_t i = 0; i < evidence.size(); ++i) {
    const netns::TestbedLink& link = state.links[session.links[i]];
    const std::string vehicle =
        state.vehicle_count() > 1
            ? netns::host_name({netns::Host::Kind::kVehicle, link.vehicle}) + "/"
            : "";
    findings.links.push_back(verify::summarise(vehicle + link.name, link.profile, evidence[i]));
  }
  fmt::print("{}", o.json ? verify::to_json(findings) : verify::to_table(findings));
  return exit_code(verify::overall(findings));
}

}  // namespace

netns::State found_testbed(const std::string& name) {
  auto state = Testbed::find(name);
  if (!state) {
    throw process::Failure(
        process::kFailed,
        "testbed '" + name + "' is not up; `interneuron testbed up --name " + name + "` makes it");
  }
  return *state;
}

void add_testbed_verify(CLI::App& testbed, std::function<int()>& run) {
  auto o = std::make_shared<LinkCheckOptions>();
  CLI::App* c = testbed.add_subcommand(
      "verify", "Measure the links with ping, iperf3 and tcpdump, and compare with their schedule");
  c->add_option("--name", o->name, "Name of the testbed")->capture_default_str();
  c->add_option("--link", o->links,
                "5g, vehicle2/5g, or * (default: all of the first vehicle); once per link")
      ->take_all();
  c->add_option("--seconds", o->seconds, "How long it may take")
      ->capture_default_str()
      ->check(CLI::Range(kShortest, kLongest));
  c->add_flag("--json", o->json, "As JSON");
  c->footer(
      "The links should carry nothing else meanwhile.\n"
      "Exit codes: 0 all figures are within their bounds, 1 one is not, 77 this machine cannot "
      "tell.");
  c->callback([&run, o] { run = [o] { return run_verify(*o); }; });
}

}  // namespace interneuron::cli
