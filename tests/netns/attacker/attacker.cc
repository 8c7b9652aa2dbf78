// The generator of attacks for tests/netns/insider_acceptance.py: what one hostile vehicle, or one
// hostile host beside the road, can send at a roadside unit. It refuses to send anywhere but over a
// veth in a namespace of a test. Prints one line of JSON.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <random>

#include "interneuron/node.h"
#include "tests/netns/attacker/amplify.h"
#include "tests/netns/attacker/flood.h"
#include "tests/netns/attacker/insider.h"
#include "tests/netns/attacker/outsider.h"
#include "tests/netns/attacker/sealed_channel.h"

namespace interneuron::attacker {
namespace {

struct JoinOptions {
  std::string nic;
  std::string road;
  double seconds = 10;
  // Its own key and the road's; empty: in the clear.
  std::string key;
  std::string road_key;
};

std::shared_ptr<Security> security_of(const JoinOptions& o) {
  if (o.key.empty()) return nullptr;
  std::random_device device;
  std::mt19937_64 random(std::uint64_t{device()} << 32 | device());
  auto security = std::make_shared<Security>();
  security->key = read_key(o.key);
  security->peers = {{read_public_key(o.road_key), {}}};
  security->seed = draw_key(random);
  security->unix_time_ns = unix_time_ns();
  return security;
}

// How long it takes until a new honest vehicle may exchange messages: a Node like that of the
// program `vehicle`, new each time.
int run_join(const JoinOptions& o) {
  require_confined(o.nic);
  NodeOptions options;
  options.security = security_of(o);
  options.insecure = options.security == nullptr;
  options.links = {{.id = {1}, .nic = o.nic, .peer = o.road}};
  const TimePoint began = now();
  Node node(options);
  std::optional<TimePoint> joined;
  node.on_peer_ready([&](PeerReady) {
    joined = now();
    node.stop();
  });
  node.after(std::chrono::milliseconds(static_cast<int>(1000 * o.seconds)), [&] { node.stop(); });
  node.run();
  std::printf("{\"joined\": %s, \"join_s\": %.3f}\n", joined ? "true" : "false",
              seconds_between(began, joined.value_or(now())));
  return joined ? 0 : 1;
}

void add_seconds(CLI::App* c, double& seconds) {
  c->add_option("--seconds", seconds, "For how long")->capture_default_str();
}

// Without them everything is in the clear.
void add_keys(CLI::App* c, std::string& key, std::string& road_key) {
  c->add_option("--key", key, "File with its private key");
  c->add_option("--road-key", road_key, "The roadside unit's public key");
}

void add_insider(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<InsiderOptions>();
  auto road = std::make_shared<std::string>();
  CLI::App* c = program.add_subcommand("insider", "One admitted peer that attacks");
  c->add_option("--nic", o->nic, "The NIC")->required();
  c->add_option("--road", *road, "ADDRESS:PORT of the roadside unit")->required();
  c->add_option("--attack", o->attack, "The attack")
      ->required()
      ->check(CLI::IsMember(insider_attacks()));
  c->add_option("--kbit", o->kbit, "Bound of what it sends, kbit/s")->capture_default_str();
  c->add_option("--victim-session", o->victim_session, "In whose name foreign_origin speaks");
  c->add_option("--seed", o->seed, "Seed")->capture_default_str();
  add_keys(c, o->key, o->road_key);
  add_seconds(c, o->seconds);
  c->callback([&run, o, road] {
    o->road = parse_place(*road);
    run = [o] { return run_insider(*o); };
  });
}

void add_flood(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<FloodOptions>();
  auto road = std::make_shared<std::string>();
  CLI::App* c = program.add_subcommand("flood", "Peers without end that want to join");
  c->add_option("--nic", o->nic, "The NIC")->required();
  c->add_option("--road", *road, "ADDRESS:PORT of the roadside unit")->required();
  c->add_option("--spoofed", o->spoofed, "Network of forged sources")->capture_default_str();
  c->add_option("--owned", o->owned, "Network whose tokens it answers")->capture_default_str();
  c->add_option("--spoofed-pps", o->spoofed_pps, "Packets per second")->capture_default_str();
  c->add_option("--owned-pps", o->owned_pps, "Packets per second")->capture_default_str();
  c->add_option("--seed", o->seed, "Seed")->capture_default_str();
  c->add_option("--road-key", o->road_key, "The unit's public key: then they ask for handshakes");
  add_seconds(c, o->seconds);
  c->callback([&run, o, road] {
    o->road = parse_place(*road);
    run = [o] { return run_flood(*o); };
  });
}

void add_amplify(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<AmplifyOptions>();
  CLI::App* c = program.add_subcommand("amplify", "Packets in the name of victims");
  c->add_option("--nic", o->nics, "A NIC")->required();
  c->add_option("--road", o->roads, "ADDRESS:PORT of the unit over the NIC in the same place")
      ->required();
  c->add_option("--victims", o->victims, "Network of the victims")->capture_default_str();
  c->add_option("--seed", o->seed, "Seed")->capture_default_str();
  c->add_option("--key", o->keys, "A file with a key that the unit trusts, one for each victim");
  c->add_option("--road-key", o->road_key, "The unit's public key");
  add_seconds(c, o->seconds);
  c->callback([&run, o] { run = [o] { return run_amplify(*o); }; });
}

void add_outsider(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<OutsiderOptions>();
  CLI::App* c = program.add_subcommand("outsider", "All that needs no key, from the way between");
  c->add_option("--road-nic", o->road_nics, "A NIC towards the unit")->required();
  c->add_option("--vehicle-nic", o->vehicle_nics, "The NIC of the same link towards the vehicle")
      ->required();
  c->add_option("--old", o->old, "Capture of a former life of the vehicle");
  c->add_option("--road-key", o->road_key, "The unit's public key")->required();
  c->add_option("--spoofed", o->spoofed, "Network of forged sources")->capture_default_str();
  c->add_option("--packets", o->packets, "How many")->capture_default_str();
  c->add_option("--pps", o->pps, "Packets per second")->capture_default_str();
  c->add_option("--seed", o->seed, "Seed")->capture_default_str();
  c->callback([&run, o] { run = [o] { return run_outsider(*o); }; });
}

void add_others(CLI::App& program, std::function<int()>& run) {
  auto stamp = std::make_shared<StampOptions>();
  auto from = std::make_shared<std::string>();
  auto to = std::make_shared<std::string>();
  CLI::App* s = program.add_subcommand("stamp", "One forged STAMP request");
  s->add_option("--nic", stamp->nic, "The NIC")->required();
  s->add_option("--from", *from, "ADDRESS:PORT in whose name")->required();
  s->add_option("--to", *to, "ADDRESS:PORT of the reflector")->required();
  s->callback([&run, stamp, from, to] {
    stamp->from = parse_place(*from);
    stamp->to = parse_place(*to);
    run = [stamp] { return run_stamp(*stamp); };
  });
  auto join = std::make_shared<JoinOptions>();
  CLI::App* j = program.add_subcommand("join", "A new honest peer; how long it takes to join");
  j->add_option("--nic", join->nic, "The NIC")->required();
  j->add_option("--road", join->road, "ADDRESS:PORT of the roadside unit")->required();
  add_keys(j, join->key, join->road_key);
  add_seconds(j, join->seconds);
  j->callback([&run, join] { run = [join] { return run_join(*join); }; });
}

int run_program(int argc, char** argv) {
  CLI::App program{"Attacks on a roadside unit, inside a test's network namespace"};
  program.require_subcommand(1);
  program.footer("Exit codes: 0 fine, 1 not admitted or failed, 2 usage or refused.");
  std::function<int()> run;
  add_insider(program, run);
  add_flood(program, run);
  add_amplify(program, run);
  add_outsider(program, run);
  add_others(program, run);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  }
  return run();
}

}  // namespace
}  // namespace interneuron::attacker

int main(int argc, char** argv) {
  try {
    return interneuron::attacker::run_program(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "attacker: %s\n", error.what());
    return 2;
  }
}
