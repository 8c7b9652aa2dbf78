#include "app/offload/command.h"

#include "app/offload/road.h"
#include "app/offload/vehicle.h"
#include "app/process/failure.h"
#include "app/settings/command_line.h"
#include "app/settings/config_file.h"
#include "app/settings/link_options.h"
#include "core/wire/stamp.h"
#include "interneuron/policy.h"
#include "interneuron/shard.h"

namespace interneuron::offload {

namespace {

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const auto& policy : builtin_policies()) names.emplace_back(policy->name());
  return names;
}

// Adds --stamp [PORT], --stamp-stateless and --stamp-public.
void add_stamp_options(CLI::App& command, StampOptions& options) {
  command
      .add_option("--stamp", options.port,
                  "Also answer STAMP test packets (RFC 8762, unauthenticated) on this UDP port")
      ->expected(0, 1)
      ->default_str(std::to_string(wire::kStampPort))
      ->check(CLI::Range(1, 65535))
      ->type_name("[PORT]");
  command.add_flag("--stamp-stateless", options.stateless,
                   "Number STAMP answers as the requests are, instead of counting them");
  command.add_flag("--stamp-public", options.is_public,
                   "Answer STAMP test packets on public addresses, too: anybody can ask");
}

// What several shards cannot do is a mistake of usage before anything is opened.
void check_shards(const RoadOptions& o) {
  if (o.shards == 1) return;
  const auto refuse = [](const std::string& with) {
    throw process::Failure(process::kUsage, "--shards: not with " + with + "; take one shard");
  };
  if (settings::transport_kind(o.transport) != TransportKind::kUdp) {
    refuse("--transport " + o.transport);
  }
  if (!o.relays.empty()) refuse("--relay");
}

}  // namespace

void add_images_option(CLI::App* c, std::string& images) {
  c->add_option("--images", images,
                "Variants of a frame: the paper's bitmaps, or JPEGs of four sizes and qualities")
      ->capture_default_str()
      ->check(CLI::IsMember({"paper", "jpeg"}));
}

void add_deadline_options(CLI::App* c, double& deadline_ms, std::string& guard, std::string& policy,
                          double& objective) {
  c->add_option("--deadline-ms", deadline_ms, "End-to-end deadline D_N, milliseconds")
      ->capture_default_str()
      ->check(settings::positive_number());
  c->add_option("--guard", guard,
                "The rule that trades quality for time: the paper's, or by what is left of the "
                "deadline")
      ->capture_default_str()
      ->check(CLI::IsMember({"paper", "budget"}));
  c->add_option(
       "--policy", policy,
       "Which variants go over which links, see policies/README.md (default: joint, for the "
       "paper's images down_sampling)")
      ->check(CLI::IsMember(policy_names()));
  c->add_option("--objective", objective, "Per cent of rounds on time; fewer end with exit code 4")
      ->check(CLI::Range(0.0, 100.0));
}

void add_input_options(CLI::App* c, std::string& video, std::string& data, std::string& ladder,
                       const std::vector<std::string>& more_ladders) {
  std::vector<std::string> ladders{"auto", "dnn", "motion", "replay"};
  ladders.insert(ladders.end(), more_ladders.begin(), more_ladders.end());
  c->add_option("--video", video,
                "Video file, folder of images, stream or camera:N (default: the demo's video)");
  c->add_option(
      "--data", data,
      "Folder with models and videos (default: INTERNEURON_DATA, ../shared/data, build/data)");
  c->add_option(
       "--ladder", ladder,
       "Detectors; auto: of dnn (needs models) and motion (needs a fixed camera) those with "
       "the higher AP in half the deadline")
      ->capture_default_str()
      ->check(CLI::IsMember(ladders));
}

void add_calibration_option(CLI::App* c, int& runs) {
  c->add_option("--calibration-runs", runs, "Runs per level at start-up")
      ->capture_default_str()
      ->check(CLI::Range(1, 10'000));
}

CLI::App* add_vehicle(CLI::App& program, std::function<int()>& run,
                      MakeHooks<VehicleHooks> make_hooks) {
  auto o = std::make_shared<VehicleOptions>();
  auto no_table = std::make_shared<bool>(false);
  CLI::App* c = program.add_subcommand(
      "vehicle", "Send camera frames through the pipeline; one answer per round");
  settings::add_config_option(*c);
  settings::add_link_option(*c, "--link", o->links, settings::LinkPeer::kNamed);
  settings::add_key_options(*c, o->keys, settings::Trusts::kThePeer);
  c->add_option("--port", o->port, "Local UDP port on every card; 0: any")->capture_default_str();
  settings::add_transport_option(*c, o->transport);
  c->add_option("--rounds", o->rounds, "Rounds; 0: to the end of the video or Ctrl-C")
      ->capture_default_str();
  c->add_option("--period-ms", o->period_ms, "Between two frames, milliseconds")
      ->capture_default_str()
      ->check(settings::positive_number());
  add_images_option(c, o->images);
  add_deadline_options(c, o->deadline_ms, o->guard, o->policy, o->objective);
  c->add_option("--beta", o->beta, "β of the guard's tolerance X")
      ->capture_default_str()
      ->check(CLI::Range(-1.0, 30.0));
  c->add_option("--wait-s", o->wait_s, "For the roadside unit to answer, seconds")
      ->capture_default_str()
      ->check(settings::positive_number());
  add_input_options(c, o->video, o->data, o->ladder);
  c->add_option("--truth", o->truth, "Ground truth (MOT15 gt.txt) of the video, or none");
  c->add_option(
      "--out", o->out,
      "Folder for rounds.csv, summary.json, latency.png, frame.png (default: nothing is written)");
  c->add_flag("--json", o->json, "The summary as JSON on stdout");
  c->add_flag("-q,--quiet", o->quiet, "No progress line and no table");
  c->add_flag("--no-table", *no_table, "No table")->group("");
  c->add_option("--profile", o->profiles, "Told in the summary")->take_all()->group("");
  c->add_option("--seed", o->seed, "Told in the summary")->group("");
  c->footer(
      "Examples (ROAD_KEY: what `interneuron keys gen` printed on the roadside unit):\n"
      "  interneuron vehicle --link wwan0=192.0.2.7:47000 --link wwan1=192.0.2.7:47000 "
      "--peer-key ROAD_KEY --video camera:0\n"
      "  interneuron vehicle --link 'wwan0=192.0.2.7:47000' --link "
      "'wlan*=192.0.2.7:47000,role=backup' --peer-key ROAD_KEY\n"
      "  interneuron vehicle --config vehicle.toml --rounds 300 --out out/run");
  c->callback([&run, o, no_table, make_hooks] {
    run = [o, no_table, make_hooks] {
      o->table = !*no_table;
      const auto hooks = make_hooks ? make_hooks() : nullptr;
      return run_vehicle(*o, hooks.get());
    };
  });
  return c;
}

CLI::App* add_road(CLI::App& program, std::function<int()>& run, MakeHooks<RoadHooks> make_hooks) {
  auto o = std::make_shared<RoadOptions>();
  CLI::App* c = program.add_subcommand(
      "road", "A roadside unit: detects in the images of any vehicle that comes");
  settings::add_config_option(*c);
  settings::add_link_option(*c, "--nic,--link", o->nics, settings::LinkPeer::kNone);
  settings::add_key_options(*c, o->keys, settings::Trusts::kMany);
  c->add_option("--address", o->address, "Local address (default: all of the card)");
  c->add_option("--port", o->port, "UDP port on every card")->capture_default_str();
  settings::add_transport_option(*c, o->transport);
  // none: for those who only measure (links, top, probe).
  add_input_options(c, o->video, o->data, o->ladder, {kNoLadder});
  c->add_option(
       "--deadline-ms", o->deadline_ms,
       "End-to-end deadline of the vehicles, milliseconds, for which --ladder auto chooses")
      ->capture_default_str()
      ->check(settings::positive_number());
  add_calibration_option(c, o->calibration_runs);
  c->add_option("--top-level", o->top_level, "Highest level used; -1: by the vehicle's budget")
      ->capture_default_str()
      ->check(CLI::Range(-1, 255));
  c->add_option("--relay", o->relays, "Address of a peer that brings other vehicles' rounds")
      ->option_text("ADDRESS …");
  c->add_option("--max-peers", o->max_peers, "Vehicles at once")
      ->capture_default_str()
      ->check(CLI::Range(1, 10'000));
  c->add_option("--shards", o->shards,
                "Threads that serve vehicles, each with sockets of its own; 1: one thread does all")
      ->capture_default_str()
      ->check(CLI::Range(1, int{kMaxShards}));
  add_stamp_options(*c, o->stamp);
  c->footer(
      "Examples:\n  interneuron road --nic eth0 --trust VEHICLE_KEY --trust "
      "OTHER_KEY,psk=other.psk\n"
      "  interneuron road --nic eth0 --insecure --ladder none   # only to be measured against, in "
      "a "
      "closed network\n  interneuron road --config road.toml");
  c->callback([&run, o, make_hooks] {
    run = [o, make_hooks] {
      check_shards(*o);
      const auto hooks = make_hooks ? make_hooks() : nullptr;
      return run_road(*o, hooks.get());
    };
  });
  return c;
}

}  // namespace interneuron::offload
