#include "app/cli/commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "app/doctor/judge.h"
#include "app/doctor/measurements.h"
#include "app/process/failure.h"
#include "app/settings/peer_address.h"

namespace interneuron::cli {
namespace {

using doctor::Finding;
using doctor::Verdict;
using Json = nlohmann::ordered_json;

// Twice what an idle link needs at most (2 * doctor::kKeepAliveSeconds), seconds.
constexpr int kDefaultNatTimeoutS = 60;

struct DoctorOptions {
  std::string peer;
  // The longest silence to be tried, seconds; 0: none.
  int nat_timeout_s = 0;
  bool json = false;
};

std::ptrdiff_t count(const std::vector<Finding>& findings, Verdict verdict) {
  return std::ranges::count(findings, verdict, &Finding::verdict);
}

Json findings_json(const std::vector<Finding>& findings) {
  Json json{{"schema", "interneuron.doctor/1"},
            {"problems", count(findings, Verdict::kProblem)},
            {"warnings", count(findings, Verdict::kWarning)},
            {"findings", Json::array()}};
  for (const Finding& f : findings) {
    json["findings"].push_back({{"check", f.check},
                                {"subject", f.subject},
                                {"verdict", doctor::to_string(f.verdict)},
                                {"found", f.found},
                                {"fix", f.fix}});
  }
  return json;
}

void print(const std::vector<Finding>& findings) {
  const std::string* subject = nullptr;
  for (const Finding& f : findings) {
    if (subject == nullptr || *subject != f.subject) {
      fmt::print("{}{}\n", subject == nullptr ? "" : "\n", f.subject);
    }
    subject = &f.subject;
    const bool bad = f.verdict == Verdict::kProblem;
    fmt::print("  {:<11}  {:<20}  {}\n", bad ? "PROBLEM" : doctor::to_string(f.verdict), f.check,
               f.found);
    for (const std::string& command : f.fix) fmt::print("{:15}fix: {}\n", "", command);
  }
  fmt::print("\n{} problem(s), {} warning(s), {} ok, {} not checked; nothing was changed\n",
             count(findings, Verdict::kProblem), count(findings, Verdict::kWarning),
             count(findings, Verdict::kOk), count(findings, Verdict::kNotChecked));
}

// Behind the others of its NIC.
void add(std::vector<Finding>& findings, Finding finding) {
  const auto last =
      std::ranges::find(findings.rbegin(), findings.rend(), finding.subject, &Finding::subject);
  findings.insert(last.base(), std::move(finding));
}

// What it takes to send to the peer for.
void examine_paths(const DoctorOptions& o, const Address& peer, const io::HostFacts& facts,
                   std::vector<Finding>& findings) {
  for (const io::NicHostFacts& nic : facts.nics) {
    if (!doctor::is_usable(facts, nic) || !nic.routed) continue;
    fmt::print(stderr, "{}: echo requests to {} …\n", nic.nic.name, o.peer);
    add(findings,
        doctor::judge_path(doctor::probe_path_mtu(nic.nic.name, nic.nic.mtu, peer), nic.nic.mtu));
  }
  if (o.nat_timeout_s > 0) {
    const probe::Silence limit(o.nat_timeout_s);
    for (const doctor::NatTimeout& measured : doctor::measure_nat_timeouts(facts, limit)) {
      add(findings, doctor::judge_nat(measured));
    }
    return;
  }
  for (const io::NicHostFacts& nic : facts.nics) {
    if (!doctor::is_usable(facts, nic) || !doctor::is_routed(nic)) continue;
    add(findings,
        doctor::judge_nat({.nic = nic.nic.name, .limit = {}, .flows = {}, .cut_short = {}}));
  }
}

int examine(const DoctorOptions& o) {
  std::optional<Address> peer;
  if (!o.peer.empty()) peer = settings::resolve_peer(o.peer);
  const io::HostFacts facts = io::read_host_facts(peer);
  std::vector<Finding> findings = doctor::judge(facts);
  if (peer) examine_paths(o, *peer, facts, findings);
  if (o.json) {
    fmt::print("{}\n", findings_json(findings).dump(2));
  } else {
    print(findings);
  }
  return count(findings, Verdict::kProblem) > 0 ? process::kFailed : process::kFine;
}

}  // namespace

void add_doctor(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<DoctorOptions>();
  CLI::App* c = program.add_subcommand(
      "doctor", "Is this host set up for several network cards at once? Changes nothing");
  CLI::Option* peer =
      c->add_option("--peer", o->peer,
                    "HOST[:PORT] of a roadside unit: are the cards routed to it, and how large may "
                    "a packet be (sends echo requests)");
  c->add_option("--nat-timeout", o->nat_timeout_s,
                "Also measure how long silent UDP flows to the peer, an `interneuron road "
                "--insecure`, stay open; up to so many seconds, which it takes")
      ->needs(peer)
      ->expected(0, 1)
      ->default_str(std::to_string(kDefaultNatTimeoutS))
      ->check(CLI::Range(probe::kShortestSilence.count(), probe::kLongestSilence.count()))
      ->type_name("[SECONDS]");
  c->add_flag("--json", o->json, "As JSON (docs/schema/doctor.json)");
  c->footer(
      "Ends with 1 when there is a problem, else with 0.\n"
      "Examples:\n  interneuron doctor\n  interneuron doctor --peer 192.0.2.7\n"
      "  interneuron doctor --peer 192.0.2.7 --nat-timeout 120\n"
      "  interneuron doctor --json | jq -r '.findings[].fix[]'");
  c->callback([&run, o] { run = [o] { return examine(*o); }; });
}

}  // namespace interneuron::cli
