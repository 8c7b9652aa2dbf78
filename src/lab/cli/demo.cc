#include "lab/cli/commands.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "app/offload/command.h"
#include "app/offload/road.h"
#include "app/offload/vehicle.h"
#include "app/perception/codec.h"
#include "app/perception/detection.h"
#include "app/perception/frame_source.h"
#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "app/process/sibling.h"
#include "app/process/signals.h"
#include "app/records/run_files.h"
#include "app/records/verdict.h"
#include "app/settings/data.h"
#include "app/settings/key_files.h"
#include "lab/sim/feasibility.h"
#include "netns/state/hosts.h"
#include "netns/state/options.h"
#include "netns/state/scenario.h"
#include "netns/state/snapshot.h"
#include "netns/state/state.h"
#include "netns/testbed/road_child.h"
#include "netns/testbed/testbed.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;
using netns::Testbed;

constexpr std::uint16_t kPort = 47000;

using Ladder = netns::RoadChild::Ladder;

struct DemoOptions {
  std::uint32_t rounds = 300;
  std::uint64_t seed = 1;
  std::string out = "out/demo";
  // Profiles by name or file; none: 5g and 4g.
  std::vector<std::string> links;
  std::string video;
  std::string data;
  std::string ladder = "auto";
  // Runs per level in which the roadside unit measures its detectors before the first round.
  int calibration_runs = offload::RoadOptions{}.calibration_runs;
  // As VehicleOptions.
  std::string images = offload::VehicleOptions{}.images;
  std::string policy = offload::VehicleOptions{}.policy;
  std::string guard = "budget";
  double deadline_ms = 130;
  double objective = 0;
  bool json = false;
  // The file that captures the vehicle's packets; empty: none.
  std::string pcap;
};

class Demo {
 public:
  explicit Demo(const DemoOptions& options);
  // Makes a testbed, runs both programs in it and returns the exit code. A signal ends all of it:
  // then the code is 128 + the signal, the rounds that were measured are written, and without a
  // round no file is. Throws Failure or netns::TestbedError.
  int run();

 private:
  std::vector<std::string> road_command() const;
  std::vector<std::string> vehicle_command() const;
  void judge(std::vector<records::RoundRow>& rows, const netns::Snapshot& snapshot,
             const Ladder& ladder) const;
  std::size_t smallest_image() const;
  int conclude(int vehicle_code, const Ladder& ladder);

  const DemoOptions& o_;
  std::optional<fs::path> data_;
  std::string video_;
  // Holds the private keys of the two, which are gone with it.
  std::optional<process::PrivateFolder> keys_;
  // Their public halves.
  std::string road_key_;
  std::string vehicle_key_;
  netns::TestbedOptions testbed_options_;
  std::optional<Testbed> testbed_;
};

Demo::Demo(const DemoOptions& options) : o_(options), data_(settings::find_data(options.data)) {
  testbed_options_.name = fmt::format("demo-{}", ::getpid());
  testbed_options_.scenario = options.links.empty()
                                  ? netns::default_scenario(options.seed)
                                  : netns::scenario_of(options.links, options.seed);
  video_ = options.video.empty() ? settings::default_video(data_) : options.video;
  // A video that cannot be read is told once, here, and not by both programs.
  const perception::FrameSource readable(video_);
}

std::vector<std::string> Demo::road_command() const {
  std::vector<std::string> argv{process::sibling_program("interneuron-offload"),
                                "road",
                                "--port",
                                std::to_string(kPort),
                                "--ladder",
                                o_.ladder,
                                "--video",
                                video_,
                                "--deadline-ms",
                                fmt::format("{}", o_.deadline_ms),
                                "--calibration-runs",
                                std::to_string(o_.calibration_runs),
                                "--key",
                                (*keys_ / "road").string(),
                                "--trust",
                                vehicle_key_};
  if (data_) argv.insert(argv.end(), {"--data", data_->string()});
  for (const netns::TestbedLink& link : testbed_->state().links)
    argv.insert(argv.end(), {"--nic", link.nic});
  return argv;
}

std::vector<std::string> Demo::vehicle_command() const {
  std::vector<std::string> argv{process::sibling_program("interneuron-offload"),
                                "vehicle",
                                "--video",
                                video_,
                                "--ladder",
                                o_.ladder,
                                "--rounds",
                                std::to_string(o_.rounds),
                                "--guard",
                                o_.guard,
                                "--images",
                                o_.images,
                                "--deadline-ms",
                                fmt::format("{}", o_.deadline_ms),
                                "--out",
                                o_.out,
                                "--seed",
                                std::to_string(o_.seed),
                                "--key",
                                (*keys_ / "vehicle").string(),
                                "--peer-key",
                                road_key_};
  if (data_) argv.insert(argv.end(), {"--data", data_->string()});
  if (!o_.policy.empty()) argv.insert(argv.end(), {"--policy", o_.policy});
  if (!o_.pcap.empty()) argv.insert(argv.end(), {"--pcap", o_.pcap});
  for (const netns::TestbedLink& link : testbed_->state().links) {
    argv.insert(argv.end(),
                {"--link", fmt::format("{}={}:{}", link.nic, link.road_address, kPort)});
    argv.insert(argv.end(), {"--profile", link.profile});
  }
  return argv;
}

// What a clairvoyant could have answered on time over the very links of this run.
void Demo::judge(std::vector<records::RoundRow>& rows, const netns::Snapshot& snapshot,
                 const Ladder& ladder) const {
  if (!snapshot.epoch || ladder.medians.empty()) return;
  std::vector<emu::LinkProfile> profiles;
  std::vector<emu::Link> links;
  std::vector<emu::DelayProcess*> processes;
  for (const emu::ScenarioLink& link : testbed_options_.scenario.links) {
    profiles.push_back(link.profile);
    links.emplace_back(link.profile, link.seed);
    processes.push_back(links.back().process().get());
  }
  const std::size_t smallest = smallest_image();
  for (records::RoundRow& row : rows) {
    row.possible = sim::clairvoyant_feasible(profiles, processes, row.t0 - *snapshot.epoch,
                                             from_ms(o_.deadline_ms), smallest,
                                             perception::kMaxResultBytes, ladder.medians.front());
  }
}

// Bytes of the smallest variant of the video's first frame.
std::size_t Demo::smallest_image() const {
  const auto frame = perception::FrameSource(video_).next();
  const auto smallest = perception::variants_of(*perception::parse_images(o_.images)).back();
  return frame ? perception::encode_image(perception::make_variant(frame->bgr, 0, smallest)).size()
               : 0;
}

int Demo::conclude(int vehicle_code, const Ladder& ladder) {
  const fs::path out = o_.out;
  std::vector<records::RoundRow> rows = records::read_csv(out / "rounds.csv");
  judge(rows, testbed_->snapshot(), ladder);
  records::Json summary = records::read_json(out / "summary.json");
  std::uint32_t possible = 0;
  for (const records::RoundRow& row : rows) possible += row.possible.value_or(false) ? 1 : 0;
  summary["best_possible"] = possible;
  summary["ladder"] = ladder.description;
  for (records::Json& level : summary["levels"]) {
    const auto number = level["level"].get<std::size_t>();
    if (number < ladder.names.size()) level["name"] = ladder.names[number];
  }
  const netns::Snapshot snapshot = testbed_->snapshot();
  summary["emulator"] = {{"lateness_mean_us", snapshot.lateness_mean_us},
                         {"lateness_max_us", snapshot.lateness_max_us},
                         {"kernel_drops", snapshot.kernel_drops}};
  records::write_csv(out / "rounds.csv", rows);
  records::write_json(out / "summary.json", summary);
  if (o_.json) {
    fmt::print("{}\n", summary.dump(2));
  } else {
    records::print_table(summary);
    std::string files = "rounds.csv, summary.json";
    for (const char* picture : {"latency.png", "frame.png"}) {
      if (fs::exists(out / picture)) files += std::string(", ") + picture;
    }
    fmt::print("\nwritten to {}: {}\n\n{}\n", out.string(), files, records::verdict(summary));
  }
  std::fflush(stdout);
  return vehicle_code == process::kFine ? records::judge_objective(summary, o_.objective)
                                        : vehicle_code;
}

int Demo::run() {
  records::make_directory(o_.out);
  for (const char* old : {"rounds.csv", "summary.json", "latency.png", "frame.png"}) {
    std::error_code ignored;
    fs::remove(fs::path(o_.out) / old, ignored);
  }
  const process::SignalWatch signals;
  testbed_.emplace(Testbed::up(testbed_options_));
  process::SignalWatch::check();
  std::string names;
  for (const emu::ScenarioLink& link : testbed_options_.scenario.links)
    names += (names.empty() ? "" : ", ") + link.profile.name;
  spdlog::info("testbed: vehicle and roadside joined by {} (seed {})", names, o_.seed);
  keys_.emplace("interneuron-demo");
  road_key_ = settings::make_key(*keys_ / "road");
  vehicle_key_ = settings::make_key(*keys_ / "vehicle");
  spdlog::info("keys made for this run; packets are encrypted");

  netns::RoadChild road(testbed_->state(), road_command());
  netns::SpawnOptions spawn;
  // Stdout is for our own table, which says more than the vehicle's.
  spawn.stdio[1] = STDERR_FILENO;
  std::vector<std::string> command = vehicle_command();
  command.emplace_back("--no-table");
  process::Child vehicle(Testbed::spawn(testbed_->state(), netns::kVehicle, command, spawn));
  const int code = vehicle.wait();
  road.end();
  keys_.reset();
  const bool written = fs::exists(fs::path(o_.out) / "rounds.csv");
  const int result = written ? conclude(code, road.ladder()) : code;
  testbed_->down();
  if (process::SignalWatch::last() != 0) return 128 + process::SignalWatch::last();
  return result;
}

}  // namespace

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
  offload::add_images_option(c, o->images);
  offload::add_deadline_options(c, o->deadline_ms, o->guard, o->policy, o->objective);
  offload::add_input_options(c, o->video, o->data, o->ladder);
  offload::add_calibration_option(c, o->calibration_runs);
  c->add_flag("--json", o->json, "The summary as JSON on stdout");
  c->footer(
      "Examples:\n  interneuron demo\n  interneuron demo --rounds 100 --seed 2 --json\n"
      "  interneuron demo --link 5g --link clean --policy best_link");
  c->callback([&run, &program, o] {
    const CLI::Option* pcap = program.get_option("--pcap");
    if (pcap->count() > 0) o->pcap = pcap->as<std::string>();
    run = [o] { return Demo(*o).run(); };
  });
}

}  // namespace interneuron::cli
