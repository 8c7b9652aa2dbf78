// The program `interneuron`.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <functional>
#include <sstream>
#include <stdexcept>

#include "app/bench/command.h"
#include "app/cli/demo.h"
#include "app/cli/doctor_command.h"
#include "app/cli/eval/command.h"
#include "app/cli/keys_command.h"
#include "app/cli/links_command.h"
#include "app/cli/probe.h"
#include "app/cli/report/command.h"
#include "app/cli/testbed_command.h"
#include "app/cli/top_command.h"
#include "app/eval_testbed/testbed_run.h"
#include "app/offload/road.h"
#include "app/offload/vehicle.h"
#include "host/io/nic.h"
#include "host/process/failure.h"
#include "host/process/whole_file.h"
#include "host/settings/capture.h"
#include "host/settings/command_line.h"
#include "host/settings/config_file.h"
#include "host/settings/link_options.h"
#include "interneuron/policy.h"
#include "interneuron/transport.h"
#include "netns/state/error.h"
#include "perception/input_error.h"

namespace interneuron::cli {
namespace {

constexpr const char* kVersion = INTERNEURON_VERSION;

constexpr const char* kExitCodes =
    "Exit codes: 0 fine, 1 failed, 2 usage, 3 configuration or input, 4 deadline objective missed, "
    "5 needs a privilege, 77 this system cannot do it.";

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const auto& policy : builtin_policies()) names.emplace_back(policy->name());
  return names;
}

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
      ->check(positive_number());
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
                       const std::vector<std::string>& more_ladders = {}) {
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

void add_demo(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<DemoOptions>();
  CLI::App* c = program.add_subcommand(
      "demo", "A vehicle and a roadside unit over two emulated modems, on this machine");
  c->add_option("--rounds", o->rounds, "Rounds, 10 per second")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  c->add_option("--seed", o->seed, "Seed of the links' delay processes")->capture_default_str();
  c->add_option("--out", o->out, "Folder for rounds.csv, summary.json, latency.png, frame.png")
      ->capture_default_str();
  c->add_option("--link", o->links,
                "Profile (`testbed list` names them), TOML file, or NAME=either; once per link")
      ->take_all();
  add_images_option(c, o->images);
  add_deadline_options(c, o->deadline_ms, o->guard, o->policy, o->objective);
  add_input_options(c, o->video, o->data, o->ladder);
  add_calibration_option(c, o->calibration_runs);
  c->add_flag("--json", o->json, "The summary as JSON on stdout");
  c->footer(
      "Examples:\n  interneuron demo\n  interneuron demo --rounds 100 --seed 2 --json\n"
      "  interneuron demo --link 5g --link clean --policy best_link");
  c->callback([&run, &program, o] {
    const CLI::Option* pcap = program.get_option("--pcap");
    if (pcap->count() > 0) o->pcap = pcap->as<std::string>();
    run = [o] { return run_demo(*o); };
  });
}

// The order file of `eval --testbed`, which starts these programs. An empty group hides the option
// from the help.
std::shared_ptr<std::string> add_testbed_run_option(CLI::App& command) {
  auto file = std::make_shared<std::string>();
  command.add_option("--testbed-run", *file, "What eval --testbed asks for")->group("");
  return file;
}

void add_vehicle(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<VehicleOptions>();
  auto no_table = std::make_shared<bool>(false);
  CLI::App* c = program.add_subcommand(
      "vehicle", "Send camera frames through the pipeline; one answer per round");
  add_config_option(*c);
  add_link_option(*c, "--link", o->links, LinkPeer::kNamed);
  add_key_options(*c, o->keys, Trusts::kThePeer);
  c->add_option("--port", o->port, "Local UDP port on every card; 0: any")->capture_default_str();
  add_transport_option(*c, o->transport);
  c->add_option("--rounds", o->rounds, "Rounds; 0: to the end of the video or Ctrl-C")
      ->capture_default_str();
  c->add_option("--period-ms", o->period_ms, "Between two frames, milliseconds")
      ->capture_default_str()
      ->check(positive_number());
  add_images_option(c, o->images);
  add_deadline_options(c, o->deadline_ms, o->guard, o->policy, o->objective);
  c->add_option("--beta", o->beta, "β of the guard's tolerance X")
      ->capture_default_str()
      ->check(CLI::Range(-1.0, 30.0));
  c->add_option("--wait-s", o->wait_s, "For the roadside unit to answer, seconds")
      ->capture_default_str()
      ->check(positive_number());
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
  auto testbed_run = add_testbed_run_option(*c);
  c->footer(
      "Examples (ROAD_KEY: what `interneuron keys gen` printed on the roadside unit):\n"
      "  interneuron vehicle --link wwan0=192.0.2.7:47000 --link wwan1=192.0.2.7:47000 "
      "--peer-key ROAD_KEY --video camera:0\n"
      "  interneuron vehicle --link 'wwan0=192.0.2.7:47000' --link "
      "'wlan*=192.0.2.7:47000,role=backup' --peer-key ROAD_KEY\n"
      "  interneuron vehicle --config vehicle.toml --rounds 300 --out out/run");
  c->callback([&run, o, no_table, testbed_run] {
    run = [o, no_table, testbed_run] {
      o->table = !*no_table;
      if (testbed_run->empty()) return run_vehicle(*o);
      TestbedVehicle hooks(read_testbed_run(*testbed_run));
      return run_vehicle(*o, &hooks);
    };
  });
}

void add_road(CLI::App& program, std::function<int()>& run) {
  auto o = std::make_shared<RoadOptions>();
  CLI::App* c = program.add_subcommand(
      "road", "A roadside unit: detects in the images of any vehicle that comes");
  add_config_option(*c);
  add_link_option(*c, "--nic,--link", o->nics, LinkPeer::kNone);
  add_key_options(*c, o->keys, Trusts::kMany);
  c->add_option("--address", o->address, "Local address (default: all of the card)");
  c->add_option("--port", o->port, "UDP port on every card")->capture_default_str();
  add_transport_option(*c, o->transport);
  // none: for those who only measure (links, top, probe).
  add_input_options(c, o->video, o->data, o->ladder, {kNoLadder});
  c->add_option(
       "--deadline-ms", o->deadline_ms,
       "End-to-end deadline of the vehicles, milliseconds, for which --ladder auto chooses")
      ->capture_default_str()
      ->check(positive_number());
  add_calibration_option(c, o->calibration_runs);
  c->add_option("--top-level", o->top_level, "Highest level used; -1: by the vehicle's budget")
      ->capture_default_str()
      ->check(CLI::Range(-1, 255));
  c->add_option("--relay", o->relays, "Address of a peer that brings other vehicles' rounds")
      ->option_text("ADDRESS …");
  c->add_option("--max-peers", o->max_peers, "Vehicles at once")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  add_stamp_options(*c, o->stamp);
  auto testbed_run = add_testbed_run_option(*c);
  c->footer(
      "Examples:\n  interneuron road --nic eth0 --trust VEHICLE_KEY --trust "
      "OTHER_KEY,psk=other.psk\n"
      "  interneuron road --nic eth0 --insecure --ladder none   # only to be measured against, in "
      "a "
      "closed network\n  interneuron road --config road.toml");
  c->callback([&run, o, testbed_run] {
    run = [o, testbed_run] {
      if (testbed_run->empty()) return run_road(*o);
      TestbedRoad hooks(read_testbed_run(*testbed_run));
      return run_road(*o, &hooks);
    };
  });
}

bool is_command(const CLI::App& program, const std::string& name) {
  return !program.get_subcommands([&name](const CLI::App* c) { return c->get_name() == name; })
              .empty();
}

int fail(int code, const std::string& what) {
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
  return given("--config") && !given("--link") && !given("--nic") ? kConfiguration : kUsage;
}

int run_program(int argc, char** argv) {
  CLI::App program{"Interneuron: deadline-bound messages over several network cards at once"};
  program.footer(kExitCodes);
  program.require_subcommand(1);
  program.set_version_flag("--version", std::string("interneuron ") + kVersion, "The version");
  std::function<int()> run;
  std::string pcap;
  add_capture_option(program, pcap);
  add_demo(program, run);
  add_vehicle(program, run);
  add_road(program, run);
  add_keys(program, run);
  add_links(program, run);
  add_top(program, run);
  add_doctor(program, run);
  add_probe(program, run);
  add_testbed(program, run);
  add_eval(program, run);
  add_report(program, run);
  add_bench(program, run);
  program.add_subcommand("version", "The version")->callback([&run] {
    run = [] {
      std::printf("interneuron %s\n", kVersion);
      return kFine;
    };
  });
  const std::string first = argc > 1 ? argv[1] : "";
  if (!first.empty() && first.front() != '-' && !is_command(program, first)) {
    return fail(kUsage, unknown_command(program, first));
  }
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help or the version, which go the way of all output, so that a failure is seen at the end.
    if (error.get_exit_code() == 0) {
      std::ostringstream text;
      const int code = program.exit(error, text, text);
      std::fputs(text.str().c_str(), stdout);
      return code;
    }
    return fail(kUsage, mistake_in(program, error));
  }
  name_log_lines(program);
  const int unknown_nic = code_of_unknown_nic(program);
  // Before the capture, which not every transport allows.
  apply_config(*program.get_subcommands().front());
  const auto capture = start_capture(program, pcap);
  try {
    return run();
  } catch (const io::UnknownNic& error) {
    return fail(unknown_nic, error.what());
  }
}

}  // namespace
}  // namespace interneuron::cli

int main(int argc, char** argv) {
  using namespace interneuron;
  auto log = spdlog::stderr_color_mt("interneuron");
  log->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  spdlog::set_default_logger(log);
  try {
    const int code = cli::run_program(argc, argv);
    // Whatever was printed is an answer only when all of it got out.
    cli::finish_stdout();
    return code;
  } catch (const cli::Failure& error) {
    return cli::fail(error.code(), error.what());
  } catch (const perception::InputError& error) {
    return cli::fail(cli::kConfiguration, error.what());
  } catch (const netns::TestbedError& error) {
    return cli::fail(error.exit_code, error.what());
  } catch (const IoError& error) {
    return cli::fail(
        error.code() == EPERM || error.code() == EACCES ? cli::kPrivilege : cli::kFailed,
        error.what());
  } catch (const std::exception& error) {
    return cli::fail(cli::kFailed, error.what());
  }
}
