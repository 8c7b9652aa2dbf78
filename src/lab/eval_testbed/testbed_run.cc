#include "lab/eval_testbed/testbed_run.h"

#include <utility>

#include "app/perception/detection.h"
#include "app/process/failure.h"
#include "interneuron/sizes.h"
#include "node/io/steady_clock.h"

namespace interneuron::eval_testbed {
namespace {

namespace fs = std::filesystem;
using eval::Module;

records::Json levels_json(std::span<const LevelProfile> levels) {
  records::Json out = records::Json::array();
  for (const LevelProfile& level : levels) {
    out.push_back({{"median_ns", level.median.count()},
                   {"p95_ns", level.p95.count()},
                   {"quality", level.quality}});
  }
  return out;
}

// Delays the packets of the rounds into which something is injected.
void inject(NodeOptions& node, const TestbedRun& run, Module module) {
  const auto delay_of = [run, module](const Outgoing& datagram) {
    return datagram.round ? run.in(module, datagram.round->round) : Duration{};
  };
  node.wrap_transport = [delay_of](LinkId, std::unique_ptr<Transport> inner) {
    return std::make_unique<DelayedTransport>(std::move(inner), delay_of);
  };
}

const char* kind_of(const RoundDone& done, bool local_backup) {
  if (done.outcome == Outcome::kRemote) return "remote";
  if (!done.age_rounds) return "nothing";
  if (*done.age_rounds == 0) return "local";
  return done.stale_remote || !local_backup ? "stale" : "stale_local";
}

eval::Injected injected_of(const records::Json& json) {
  eval::Injected out;
  if (json.is_null()) return out;
  out.any = true;
  out.delay = Duration{json.at("delay_ns")};
  for (std::size_t m = 0; m < eval::kModules; ++m) {
    if (json.at("module") == to_string(static_cast<Module>(m))) out.module = static_cast<Module>(m);
  }
  return out;
}

}  // namespace

std::vector<LevelProfile> levels_of(const records::Json& levels) {
  std::vector<LevelProfile> out;
  for (const records::Json& level : levels) {
    out.push_back({Duration{level.at("median_ns")}, Duration{level.at("p95_ns")},
                   level.at("quality").get<std::vector<double>>()});
    if (out.back().quality.empty()) {
      out.back().quality = {static_cast<double>(out.size()) / static_cast<double>(levels.size())};
    }
  }
  return out;
}

Duration TestbedRun::in(Module module, RoundId round) const {
  if (round.value >= injected.size()) return {};
  const eval::Injected& i = injected[round.value];
  return i.any && i.module == module ? i.delay : Duration{};
}

void write_testbed_run(const fs::path& file, const TestbedRun& run) {
  records::Json injected = records::Json::array();
  for (const eval::Injected& i : run.injected) {
    injected.push_back(
        i.any ? records::Json{{"module", to_string(i.module)}, {"delay_ns", i.delay.count()}}
              : records::Json(nullptr));
  }
  std::vector<std::int64_t> runtime_ns;
  for (const Duration d : run.erdos.runtime) runtime_ns.push_back(d.count());
  records::write_json(file, {{"system", run.system.name},
                             {"injected", injected},
                             {"deadline_ns", run.deadline.count()},
                             {"erdos",
                              {{"uplink_ns", run.erdos.uplink.count()},
                               {"downlink_ns", run.erdos.downlink.count()},
                               {"runtime_ns", runtime_ns}}},
                             {"levels", levels_json(run.levels)},
                             {"local_quality", run.fallback.local},
                             {"stale_share", run.fallback.stale_share}});
}

TestbedRun read_testbed_run(const fs::path& file) {
  const auto bad = [&file](const std::string& why) {
    return process::Failure(process::kConfiguration,
                            "'" + file.string() + "': not a run of the testbed: " + why);
  };
  try {
    const records::Json json = records::read_json(file);
    TestbedRun run;
    const eval::System* system = eval::find_system(json.at("system"));
    if (system == nullptr) throw bad("no such system");
    run.system = *system;
    for (const records::Json& i : json.at("injected")) run.injected.push_back(injected_of(i));
    run.deadline = Duration{json.at("deadline_ns")};
    const records::Json& erdos = json.at("erdos");
    run.erdos = {Duration{erdos.at("uplink_ns")}, Duration{erdos.at("downlink_ns")}, {}};
    for (const std::int64_t ns : erdos.at("runtime_ns")) run.erdos.runtime.emplace_back(ns);
    run.levels = levels_of(json.at("levels"));
    run.fallback = {json.at("local_quality"), json.at("stale_share").get<std::vector<double>>()};
    run.file = file;
    return run;
  } catch (const records::Json::exception& error) {
    throw bad(error.what());
  }
}

// --- vehicle

void TestbedVehicle::configure(PipelineConfig& pipeline) const {
  const eval::System& system = run_.system;
  pipeline.policy = system.policy;
  pipeline.guard = system.guard;
  pipeline.levels = run_.levels;
  pipeline.fallback = run_.fallback;
}

void TestbedVehicle::configure(NodeOptions& node) const {
  node.ablation = std::make_shared<const Ablation>(run_.system.ablation);
  inject(node, run_, Module::kUplink);
}

Variants TestbedVehicle::submitted(const RoundRef& ref, Variants variants) {
  const std::size_t round = ref.round.value;
  if (submitted_.size() <= round) submitted_.resize(round + 1);
  submitted_[round] = io::now();
  if (!run_.system.only_variant) return variants;
  return {std::move(variants.at(*run_.system.only_variant))};
}

void TestbedVehicle::done(const RoundDone& event, const records::RoundRow& row) {
  const auto result = perception::decode_result(event.result);
  records::Json boxes = records::Json::array();
  if (result) {
    for (const perception::Box& b : result->boxes) boxes.push_back({b.x, b.y, b.w, b.h, b.score});
  }
  const std::size_t round = event.round.round.value;
  rounds_.push_back({{"round", round},
                     {"frame", row.frame},
                     {"t0_ns", event.t0.time_since_epoch().count()},
                     {"submitted_ns", submitted_.at(round).time_since_epoch().count()},
                     {"e2e_ns", event.e2e.count()},
                     {"shown", kind_of(event, run_.system.local_backup)},
                     {"age", event.age_rounds.value_or(0)},
                     {"level", result ? result->level : 0},
                     {"variant", result ? static_cast<int>(result->variant) : 0},
                     {"degraded_final", event.degraded_final},
                     {"x_permille", event.x_permille},
                     {"recovering", event.recovering},
                     {"plan", row.plan},
                     {"boxes", boxes}});
}

void TestbedVehicle::finished(const std::vector<Statistics::Link>& links) {
  records::Json bytes = records::Json::array();
  const auto ip = [](std::uint64_t packets, std::uint64_t payload) {
    return payload + packets * kIpUdpBytes;
  };
  for (const Statistics::Link& link : links) {
    const LinkCounters& c = link.counters;
    bytes.push_back({{"up", ip(c.sent_packets, c.sent_bytes)},
                     {"down", ip(c.received_packets, c.received_bytes)}});
  }
  records::write_json(run_.file.parent_path() / "vehicle.json",
                      {{"links", bytes}, {"rounds", rounds_}});
}

// --- roadside

void TestbedRoad::configure(NodeOptions& node) const { inject(node, run_, Module::kDownlink); }

Duration TestbedRoad::before_compute(RoundId round) const {
  return run_.in(Module::kBeforeCompute, round);
}
Duration TestbedRoad::inside_compute(RoundId round) const {
  return run_.in(Module::kInsideCompute, round);
}

std::optional<std::size_t> TestbedRoad::level(std::span<const LevelProfile> levels,
                                              TimePoint delivered, TimePoint now) const {
  switch (run_.system.level) {
    case eval::LevelRule::kFixedTop:
      return levels.size() - 1;
    case eval::LevelRule::kErdos:
      return eval::erdos_rule(run_.erdos, run_.deadline, false)(0, Duration{}, now - delivered);
    // This rule needs t0, which no roadside unit is told.
    case eval::LevelRule::kErdosE2e:
    // This one needs the law.
    case eval::LevelRule::kCausal:
    case eval::LevelRule::kGuard:
      break;
  }
  return std::nullopt;
}

void TestbedRoad::computed(const computing::Computed& c) {
  rounds_.push_back({{"round", c.round.round.value},
                     {"variant", c.variant},
                     {"level", c.level},
                     {"degraded", c.degraded},
                     {"delivered_ns", c.delivered.time_since_epoch().count()},
                     {"began_ns", c.began.time_since_epoch().count()},
                     {"ended_ns", c.ended.time_since_epoch().count()}});
}

void TestbedRoad::finished(const std::string& ladder, const std::vector<std::string>& names,
                           std::span<const LevelProfile> levels) {
  records::write_json(
      run_.file.parent_path() / "road.json",
      {{"ladder", ladder}, {"names", names}, {"levels", levels_json(levels)}, {"rounds", rounds_}});
}

}  // namespace interneuron::eval_testbed
