#include "sim/offload.h"

#include <algorithm>
#include <random>

#include "plan/budget.h"

namespace interneuron::sim {
namespace {

constexpr PipelineId kCamera{0};
// Resizing and copying a frame on the vehicle before it is handed over; measured 1 ms for 768x576.
constexpr Duration kEncode = std::chrono::milliseconds(1);
constexpr double kP95OfNormal = 1.645;  // standard deviations
// Fragment, packet, UDP and IP headers per 1,352 bytes of message.
constexpr double kWireOverhead = 1428.0 / 1352.0;

class Offload {
 public:
  explicit Offload(const OffloadOptions& options)
      : o_(options), world_(options.seed), rng_(options.seed ^ 0x9e3779b97f4a7c15ULL) {}

  OffloadResult run(const std::function<void(World&)>& prepare);

 private:
  void build();
  void begin(std::uint32_t round);
  void on_event(HostId host, Event&& event);
  void compute(Delivered&& delivered);
  Duration runtime(std::size_t level);
  void choose_top();
  void judge_feasibility();

  const OffloadOptions& o_;
  World world_;
  std::mt19937_64 rng_;
  std::normal_distribution<double> unit_{0.0, 1.0};
  HostId vehicle_ = 0;
  HostId road_ = 0;
  PeerId peer_{};
  std::vector<std::shared_ptr<emu::DelayProcess>> processes_;
  Duration road_free_at_{};
  std::vector<Duration> medians_;
  OffloadResult result_;
};

void Offload::build() {
  PipelineConfig pipeline;
  pipeline.id = kCamera;
  pipeline.stages = {StageKind::kCommunication, StageKind::kComputation, StageKind::kCommunication};
  pipeline.deadline = o_.deadline;
  pipeline.period = o_.period;
  pipeline.policy = o_.policy;
  pipeline.beta_permille = o_.beta_permille;
  pipeline.use_x = o_.use_x;
  pipeline.use_handler = o_.use_handler;

  EndpointOptions vehicle;
  vehicle.session = SessionId{0x56454831};
  vehicle.pipelines = {pipeline};
  vehicle.policies = builtin_policies();
  vehicle.repair = o_.repair;
  EndpointOptions road;
  road.session = SessionId{0x524f4144};
  road.policies = builtin_policies();
  road.accept_peers = true;
  road.repair = o_.repair;
  vehicle_ = world_.add_host(std::move(vehicle), o_.vehicle_clock);
  road_ = world_.add_host(std::move(road), o_.road_clock);
  for (std::size_t i = 0; i < o_.profiles.size(); ++i) {
    emu::Link link(o_.profiles[i], emu::link_seed(o_.seed, i));
    processes_.push_back(link.process());
    world_.add_link(vehicle_, road_, LinkId{static_cast<std::uint8_t>(i)}, o_.profiles[i].name,
                    std::move(link));
  }
  for (const LevelRuntime& level : o_.ladder) medians_.push_back(level.median);
  world_.on_event([this](HostId host, Event&& event) { on_event(host, std::move(event)); });
}

void Offload::choose_top() {
  if (o_.top_level) {
    result_.top_level = *o_.top_level;
    return;
  }
  const auto links = world_.endpoint(vehicle_).links(world_.local_time(vehicle_), peer_);
  const Duration budget =
      compute_budget(o_.deadline - kEncode, links, o_.raw_bytes, o_.result_bytes);
  for (std::size_t level = 0; level < o_.ladder.size(); ++level) {
    if (o_.ladder[level].p95 <= budget) result_.top_level = level;
  }
}

void Offload::begin(std::uint32_t number) {
  Endpoint& endpoint = world_.endpoint(vehicle_);
  const RoundRef ref = endpoint.begin_round(world_.local_time(vehicle_), kCamera);
  result_.rounds[number].round = number;
  result_.rounds[number].t0 = world_.now();
  world_.at(world_.now() + kEncode, [this, ref] {
    world_.endpoint(vehicle_).submit(world_.local_time(vehicle_), ref,
                                     {Bytes(o_.raw_bytes), Bytes(o_.sampled_bytes)},
                                     MessageClass::kData, peer_);
    world_.flush(vehicle_);
  });
  if (o_.local_backup) {
    world_.at(world_.now() + kEncode + runtime(0), [this, ref] {
      world_.endpoint(vehicle_).local_result(world_.local_time(vehicle_), ref,
                                             Bytes(o_.result_bytes));
      world_.flush(vehicle_);
    });
  }
  world_.flush(vehicle_);
}

Duration Offload::runtime(std::size_t level) {
  const LevelRuntime& r = o_.ladder[level];
  if (!o_.compute_noise) return r.median;
  const double sd = static_cast<double>((r.p95 - r.median).count()) / kP95OfNormal;
  const double drawn = static_cast<double>(r.median.count()) + std::abs(unit_(rng_)) * sd -
                       0.67 * sd;  // half-normal: skewed to the slow side, median kept
  return Duration{
      static_cast<std::int64_t>(std::max(drawn, 0.5 * static_cast<double>(r.median.count())))};
}

void Offload::on_event(HostId host, Event&& event) {
  if (auto* done = std::get_if<RoundDone>(&event); done != nullptr && host == vehicle_) {
    OffloadRound& round = result_.rounds[done->round.round.value];
    ++round.answers;
    round.done = std::move(*done);
    round.done.result.clear();
  } else if (auto* delivered = std::get_if<Delivered>(&event); delivered != nullptr) {
    compute(std::move(*delivered));
  } else if (auto* change = std::get_if<PathChanged>(&event)) {
    result_.path_changes.push_back(std::move(*change));
  }
}

void Offload::compute(Delivered&& delivered) {
  const std::size_t level = sacrificed_level(medians_, result_.top_level, delivered.verdict);
  const Duration takes = runtime(level);
  const Duration start = std::max(world_.now(), road_free_at_);
  road_free_at_ = start + takes;
  OffloadRound& round = result_.rounds[delivered.round.round.value];
  round.at_road =
      OffloadRound::AtRoad{delivered.variant, delivered.verdict, delivered.degraded, level, takes};
  world_.at(road_free_at_, [this, ref = delivered.round] {
    world_.endpoint(road_).submit(world_.local_time(road_), ref, {Bytes(o_.result_bytes)},
                                  MessageClass::kResult);
    world_.flush(road_);
  });
}

void Offload::judge_feasibility() {
  // Fresh processes of the same seed: the run has moved its own past the instants to be judged.
  std::vector<emu::Link> links;
  std::vector<emu::DelayProcess*> processes;
  for (std::size_t i = 0; i < o_.profiles.size(); ++i) {
    links.emplace_back(o_.profiles[i], emu::link_seed(o_.seed, i));
    processes.push_back(links.back().process().get());
  }
  for (OffloadRound& round : result_.rounds) {
    round.feasible =
        clairvoyant_feasible(o_.profiles, processes, round.t0 + kEncode, o_.deadline - kEncode,
                             o_.sampled_bytes, o_.result_bytes, o_.ladder.front().median);
  }
}

OffloadResult Offload::run(const std::function<void(World&)>& prepare) {
  build();
  if (prepare) prepare(world_);
  result_.rounds.resize(o_.rounds);
  peer_ = world_.connect(vehicle_, road_);
  world_.run_until(o_.warm_up - Duration{1});
  choose_top();
  for (std::uint32_t i = 0; i < o_.rounds; ++i) {
    world_.at(o_.warm_up + i * o_.period, [this, i] { begin(i); });
    world_.run_until(o_.warm_up + i * o_.period);
    result_.max_reassembly_bytes =
        std::max(result_.max_reassembly_bytes, world_.endpoint(road_).reassembly_bytes());
  }
  world_.run_until(o_.warm_up + o_.rounds * o_.period + 2 * o_.deadline);
  for (std::size_t i = 0; i < o_.profiles.size(); ++i) {
    result_.up.push_back(world_.stats(LinkId{static_cast<std::uint8_t>(i)}, true));
    result_.down.push_back(world_.stats(LinkId{static_cast<std::uint8_t>(i)}, false));
  }
  judge_feasibility();
  return std::move(result_);
}

}  // namespace

std::vector<LevelRuntime> default_ladder() {
  using std::chrono::microseconds;
  return {{"L0", microseconds(7900), microseconds(9800)},
          {"L2", microseconds(18600), microseconds(23600)},
          {"L4", microseconds(43900), microseconds(46000)}};
}

std::uint32_t OffloadResult::on_time() const {
  return static_cast<std::uint32_t>(std::ranges::count_if(rounds, [](const OffloadRound& r) {
    return r.answered() && r.done.outcome == Outcome::kRemote;
  }));
}

std::uint32_t OffloadResult::feasible() const {
  return static_cast<std::uint32_t>(
      std::ranges::count_if(rounds, [](const OffloadRound& r) { return r.feasible; }));
}

OffloadResult run_offload(const OffloadOptions& options,
                          const std::function<void(World&)>& prepare) {
  return Offload(options).run(prepare);
}

bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute) {
  const auto on_wire = [](std::size_t n) {
    return static_cast<std::size_t>(static_cast<double>(n) * kWireOverhead);
  };
  Duration at_road = Duration::max();
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent = t0 + profiles[i].up.rate.transmit_time(on_wire(smallest_bytes));
    at_road = std::min(at_road, sent + processes[i]->at(sent).rtt / 2);
  }
  const Duration computed = at_road + fastest_compute;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent = computed + profiles[i].down.rate.transmit_time(on_wire(result_bytes));
    if (sent + processes[i]->at(sent).rtt / 2 <= t0 + deadline) return true;
  }
  return false;
}

}  // namespace interneuron::sim
