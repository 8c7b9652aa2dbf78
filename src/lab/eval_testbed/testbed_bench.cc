#include "lab/eval_testbed/testbed.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "app/process/sibling.h"
#include "app/process/signals.h"
#include "app/settings/data.h"
#include "app/settings/key_files.h"
#include "core/base/statistics.h"
#include "lab/sim/offload.h"
#include "netns/testbed/road_child.h"

namespace interneuron::eval_testbed {
namespace {

namespace fs = std::filesystem;
using netns::Testbed;

constexpr std::uint16_t kPort = 47000;
// Files of the bench's private folder.
constexpr const char* kRoadKeyFile = "road.key";
constexpr const char* kVehicleKeyFile = "vehicle.key";
// Fewest runs of a level that tell its 95th percentile: two of 40 lie above it, so that one stray
// run does not decide.
constexpr std::size_t kEnoughRuns = 40;

// Constant links draw nothing, so one testbed serves every seed.
Testbed up(const eval::Scenario& scenario, const fs::path& scratch) {
  std::vector<emu::ScenarioLink> links;
  for (const emu::LinkProfile& link : scenario.links) links.push_back({link.name, link, 1});
  netns::TestbedOptions options{.name = fmt::format("eval-{}", ::getpid()),
                                .scenario = emu::plain_scenario(links, 1),
                                .backend = netns::Backend::kEmulator,
                                .runtime_dir = scratch};
  return Testbed::up(options);
}

// A file that takes the stderr of a program; closed with this object.
class Log {
 public:
  explicit Log(fs::path file)
      : file_(std::move(file)),
        fd_(::open(file_.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600)) {}
  ~Log() { ::close(fd_); }
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  int fd() const { return fd_; }
  std::string last_line() const {
    std::ifstream in(file_);
    std::string last;
    for (std::string line; std::getline(in, line);) last = line.empty() ? last : line;
    return last;
  }

 private:
  fs::path file_;
  int fd_;
};

eval::Shown shown_of(const records::Json& round) {
  using Kind = eval::Shown::Kind;
  const std::string kind = round.at("shown");
  const eval::Shown remote{Kind::kRemote, round.at("level"), round.at("variant"), 0};
  if (kind == "remote") return remote;
  if (kind == "local") return {Kind::kLocal, 0, 0, 0};
  if (kind == "stale") return {Kind::kStale, remote.level, remote.variant, round.at("age")};
  if (kind == "stale_local") return {Kind::kStale, 0, 0, round.at("age")};
  return {};
}

eval::Round round_of(const records::Json& json) {
  eval::Round round;
  round.round = json.at("round");
  round.t0 = Duration{json.at("t0_ns")};
  round.e2e = Duration{json.at("e2e_ns")};
  round.shown = shown_of(json);
  round.on_time = round.shown.kind == eval::Shown::Kind::kRemote;
  round.plan = json.at("plan");
  round.degraded_final = json.at("degraded_final");
  round.x_permille = json.at("x_permille");
  round.recovering = json.at("recovering");
  return round;
}

// Adds what the roadside unit saw. Both programs read the one clock of this host, so their instants
// can be compared.
void add_road(const records::Json& json, eval::Round& round) {
  round.delivered = Duration{json.at("delivered_ns")} - round.t0;
  round.compute_began = Duration{json.at("began_ns")} - round.t0;
  round.compute_ended = Duration{json.at("ended_ns")} - round.t0;
  round.variant = json.at("variant");
  round.level = json.at("level");
  round.degraded_first = json.at("degraded");
}

perception::Shown boxes_of(const records::Json& json) {
  perception::Shown shown{.frame = json.at("frame")};
  for (const records::Json& b : json.at("boxes"))
    shown.boxes.push_back({b[0], b[1], b[2], b[3], b[4]});
  return shown;
}

Duration inside(const eval::Injected& injected) {
  return injected.any && injected.module == eval::Module::kInsideCompute ? injected.delay
                                                                         : Duration{};
}

// The medians of a run's transmissions.
struct Transmissions {
  // From t0 until the hand-over.
  Duration uplink{};
  // From the end of the computation until the answer.
  Duration downlink{};
};

// Nothing when no round was on time.
std::optional<Transmissions> transmissions(const eval::Run& run) {
  std::vector<double> uplink;
  std::vector<double> downlink;
  for (const eval::Round& round : run.rounds) {
    if (round.delivered) uplink.push_back(to_ms(*round.delivered));
    if (round.on_time && round.compute_ended) {
      downlink.push_back(to_ms(round.e2e - *round.compute_ended));
    }
  }
  if (downlink.empty()) return std::nullopt;
  return Transmissions{from_ms(percentile(uplink, 0.5)), from_ms(percentile(downlink, 0.5))};
}

// Adds how long each computation at this level took in a run, without what was injected, in ms.
void add_times(const BenchRun& bench, std::size_t level, std::vector<double>& times) {
  for (const eval::Round& r : bench.run.rounds) {
    if (!r.compute_ended || r.level != level) continue;
    times.push_back(to_ms(*r.compute_ended - *r.compute_began - inside(r.injected)));
  }
}

}  // namespace

Bench::Bench(const eval::Scenario& scenario, std::optional<fs::path> data, std::string ladder,
             fs::path scratch)
    : scenario_(scenario),
      data_(std::move(data)),
      kind_(std::move(ladder)),
      scratch_(std::move(scratch)),
      video_(settings::default_video(data_)),
      testbed_(up(scenario, (process::make_private_folder(scratch_), scratch_))),
      road_key_(settings::make_key(scratch_ / kRoadKeyFile)),
      vehicle_key_(settings::make_key(scratch_ / kVehicleKeyFile)) {}

std::vector<std::string> Bench::road_command() const {
  std::vector<std::string> argv{process::own_program(),
                                "road",
                                "--port",
                                std::to_string(kPort),
                                "--video",
                                video_,
                                "--testbed-run",
                                (scratch_ / "run.json").string()};
  argv.insert(argv.end(), {"--ladder", kind_, "--key", (scratch_ / kRoadKeyFile).string(),
                           "--trust", vehicle_key_});
  if (data_) argv.insert(argv.end(), {"--data", data_->string()});
  for (const netns::TestbedLink& link : testbed_.state().links) {
    argv.insert(argv.end(), {"--nic", link.nic});
  }
  return argv;
}

std::vector<std::string> Bench::vehicle_command(const TestbedRun& orders,
                                                std::uint32_t rounds) const {
  std::vector<std::string> argv{process::own_program(),
                                "vehicle",
                                "--images",
                                std::string(to_string(perception::Images::kPaper)),
                                "--video",
                                video_,
                                "--rounds",
                                std::to_string(rounds),
                                "--truth",
                                "none",
                                "--quiet",
                                "--testbed-run",
                                (scratch_ / "run.json").string()};
  argv.insert(argv.end(), {"--ladder", kind_, "--key", (scratch_ / kVehicleKeyFile).string(),
                           "--peer-key", road_key_});
  argv.insert(argv.end(), {"--deadline-ms", fmt::format("{:.3f}", to_ms(orders.deadline))});
  if (data_) argv.insert(argv.end(), {"--data", data_->string()});
  const auto& links = testbed_.state().links;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (orders.system.only_link.value_or(i) != i) continue;
    argv.insert(argv.end(),
                {"--link", fmt::format("{}={}:{}", links[i].nic, links[i].road_address, kPort)});
  }
  return argv;
}

void Bench::start_programs(const TestbedRun& orders, std::uint32_t rounds) {
  for (const char* record : {"vehicle.json", "road.json"}) fs::remove(scratch_ / record);
  write_testbed_run(scratch_ / "run.json", orders);
  const Log road_log(scratch_ / "road.log");
  const Log vehicle_log(scratch_ / "vehicle.log");
  std::optional<netns::RoadChild> road;
  try {
    road.emplace(testbed_.state(), road_command(), road_log.fd());
  } catch (const process::Failure& error) {
    if (error.code() != process::kFailed) throw;
    throw process::Failure(process::kFailed,
                           "the testbed's roadside unit failed: " + road_log.last_line());
  }
  netns::SpawnOptions spawn{.stdio = {-1, vehicle_log.fd(), vehicle_log.fd()}};
  process::Child vehicle(
      Testbed::spawn(testbed_.state(), netns::kVehicle, vehicle_command(orders, rounds), spawn));
  const int code = vehicle.wait();
  process::SignalWatch::check();
  road->end();
  if (code != process::kFine || !fs::exists(scratch_ / "road.json")) {
    throw process::Failure(
        process::kFailed,
        fmt::format("the testbed's run of {} failed: {}", orders.system.name,
                    (code != process::kFine ? vehicle_log : road_log).last_line()));
  }
}

BenchRun Bench::collect(const TestbedRun& orders) const {
  const records::Json vehicle = records::read_json(scratch_ / "vehicle.json");
  const records::Json road = records::read_json(scratch_ / "road.json");
  BenchRun out;
  out.run.system = orders.system.name;
  for (const records::Json& json : vehicle.at("rounds")) {
    eval::Round& round = out.run.rounds.emplace_back(round_of(json));
    if (round.round < orders.injected.size()) round.injected = orders.injected[round.round];
    out.encode.push_back(Duration{json.at("submitted_ns")} - round.t0);
    out.boxes.push_back(boxes_of(json));
  }
  for (const records::Json& json : road.at("rounds")) {
    const std::size_t number = json.at("round");
    if (number < out.run.rounds.size()) add_road(json, out.run.rounds[number]);
  }
  out.run.bytes_up.resize(scenario_.links.size());
  out.run.bytes_down.resize(scenario_.links.size());
  const records::Json& links = vehicle.at("links");
  const std::size_t first = orders.system.only_link.value_or(0);
  for (std::size_t i = 0; i < links.size(); ++i) {
    out.run.bytes_up.at(first + i) = links[i].at("up");
    out.run.bytes_down.at(first + i) = links[i].at("down");
  }
  return out;
}

BenchRun Bench::start(const TestbedRun& orders, std::uint32_t rounds) {
  start_programs(orders, rounds);
  return collect(orders);
}

void Bench::calibrate(std::uint32_t rounds, std::optional<Duration> deadline) {
  TestbedRun orders;
  // The transmissions take as long at every level; without run times it takes the lowest, which a
  // slow machine computes in time too.
  orders.system = *eval::find_system("erdos_like");
  orders.deadline = scenario_.deadline;
  const BenchRun undisturbed = start(orders, rounds);
  const records::Json road = records::read_json(scratch_ / "road.json");
  ladder_ = road.at("ladder");
  profile_ = eval::default_profile();
  profile_.level_names = road.at("names").get<std::vector<std::string>>();
  profile_.levels = levels_of(road.at("levels"));
  profile_.fallback.local = eval::remote_quality(profile_, 0, 0);

  const auto took = transmissions(undisturbed.run);
  if (!took) {
    throw process::Failure(process::kFailed,
                           fmt::format("no undisturbed round was on time on this machine ({}); "
                                       "its levels are too slow for {:.0f} ms",
                                       ladder_, to_ms(scenario_.deadline)));
  }
  erdos_ = {took->uplink, took->downlink, eval::erdos_runtimes(profile_.levels)};
  deadline_ =
      deadline.value_or(took->uplink + profile_.levels.back().median + took->downlink + kSlack);
  hosts_ = host_times(orders.system, undisturbed);
}

// What undisturbed rounds took here beyond the same rounds in virtual time.
sim::HostTimes Bench::host_times(const eval::System& system, const BenchRun& undisturbed) const {
  std::vector<double> encode;
  for (const Duration time : undisturbed.encode) encode.push_back(to_ms(time));
  sim::HostTimes hosts{.encode = from_ms(percentile(encode, 0.5))};
  eval::Scenario scenario = scenario_;
  scenario.profile = profile_;
  scenario.erdos = erdos_;
  scenario.is_encrypted = true;
  scenario.hosts = hosts;
  eval::Trace quiet;
  quiet.rounds.resize(undisturbed.run.rounds.size());
  const auto here = transmissions(undisturbed.run);
  const auto sim = transmissions(eval::run(system, scenario, quiet, 1));
  if (!here || !sim) return hosts;
  hosts.image_packets = std::max(Duration{}, here->uplink - sim->uplink);
  hosts.result_packets = std::max(Duration{}, here->downlink - sim->downlink);
  return hosts;
}

BenchRun Bench::run(const eval::System& system, const eval::Trace& trace, std::uint64_t seed) {
  TestbedRun orders;
  orders.system = system;
  orders.injected = trace.rounds;
  orders.deadline = deadline_;
  orders.erdos = erdos_;
  orders.levels = profile_.levels;
  orders.fallback = profile_.fallback;
  BenchRun out = start(orders, static_cast<std::uint32_t>(trace.rounds.size()));
  out.run.seed = seed;
  return out;
}

eval::Profile measured(const eval::Profile& calibrated,
                       const std::vector<std::vector<BenchRun>>& runs) {
  eval::Profile out = calibrated;
  for (std::size_t level = 0; level < out.levels.size(); ++level) {
    std::vector<double> times;
    for (const std::vector<BenchRun>& of_system : runs) {
      for (const BenchRun& bench : of_system) add_times(bench, level, times);
    }
    if (times.size() < kEnoughRuns) continue;
    out.levels[level].median = from_ms(percentile(times, 0.5));
    out.levels[level].p95 = from_ms(percentile(times, 0.95));
  }
  return out;
}

}  // namespace interneuron::eval_testbed
