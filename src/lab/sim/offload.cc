#include "lab/sim/offload.h"

#include <algorithm>
#include <new>
#include <random>

#include "app/computing/computation_budget.h"
#include "app/computing/roadside_unit.h"
#include "lab/sim/feasibility.h"
#include "lab/sim/trust.h"

namespace interneuron::sim {
namespace {

constexpr PipelineId kCamera{0};
constexpr int kVehicleKey = 1;
constexpr int kRoadKey = 2;
// The simulated unit computes late jobs too, in the order in which they came. Under sustained
// overload (heavy-tailed delays) every system then pays for its own backlog, and results stay
// comparable with those of erdos_like, which drops nothing.
constexpr computing::UnitRules kEverything{.waiting_per_peer = SIZE_MAX, .minds_deadlines = false};
// By default glibc returns the memory of a frame to the system after each copy and requests it anew
// for the next one, which costs a third of a run's time. Once a block of this size was freed, glibc
// keeps all smaller ones (mallopt(3), M_MMAP_THRESHOLD). The block itself is never touched.
void keep_memory_of_frames() {
  constexpr std::size_t kBlock = 31 * 1024 * 1024;
  ::operator delete(::operator new(kBlock));
}

class Offload {
 public:
  explicit Offload(const OffloadOptions& options)
      : o_(options),
        world_(options.seed),
        rng_(options.seed ^ 0x9e3779b97f4a7c15ULL),
        roadside_(profiles_of(options.ladder), std::nullopt, kEverything),
        budget_(options.deadline) {}

  OffloadResult run(const std::function<void(World&)>& prepare);

 private:
  // An input is how slow its computation is, in standard deviations.
  using Unit = computing::RoadsideUnit<double>;

  void build();
  PipelineConfig pipeline() const;
  void begin(std::uint32_t round);
  void on_event(HostId host, Event&& event);
  void delivered(Delivered message);
  void start_next();
  std::size_t level_of(const Unit::Job& job, const OffloadRound& record);
  void computed();
  const Disturbance& disturbance(std::uint32_t round) const;
  double deviations(std::uint32_t round);
  Duration runtime(std::size_t level, double deviations) const;
  Duration delay_of(HostId from, const LeavingPacket& packet) const;
  void choose_top();
  void learn(const OffloadRound& round);
  void judge_feasibility();

  const OffloadOptions& o_;
  World world_;
  std::mt19937_64 rng_;
  std::normal_distribution<double> unit_{0.0, 1.0};
  Unit roadside_;
  computing::ComputationBudget budget_;
  HostId vehicle_ = 0;
  HostId road_ = 0;
  PeerId peer_{};
  std::vector<LinkId> links_;
  OffloadResult result_;
};

PipelineConfig Offload::pipeline() const {
  PipelineConfig pipeline;
  pipeline.id = kCamera;
  pipeline.stages = offload_stages();
  pipeline.deadline = o_.deadline;
  pipeline.period = o_.period;
  pipeline.policy = o_.policy;
  pipeline.beta_permille = o_.beta_permille;
  pipeline.guard = o_.guard;
  pipeline.levels = profiles_of(o_.ladder);
  pipeline.fallback = o_.fallback;
  return pipeline;
}

void Offload::build() {
  EndpointOptions vehicle{.session = SessionId{0x56454831},
                          .pipelines = {pipeline()},
                          .policies = builtin_policies(),
                          .ablation = std::make_shared<const Ablation>(o_.ablation)};
  EndpointOptions road;
  road.session = SessionId{0x524f4144};
  road.policies = builtin_policies();
  road.accept_peers = true;
  road.ablation = vehicle.ablation;
  if (o_.is_encrypted) {
    vehicle.security = security_of(kVehicleKey, {kRoadKey});
    road.security = security_of(kRoadKey, {kVehicleKey});
  }
  vehicle_ = world_.add_host(std::move(vehicle), o_.vehicle_clock);
  road_ = world_.add_host(std::move(road), o_.road_clock);
  for (std::size_t i = 0; i < o_.profiles.size(); ++i) {
    if (o_.only_link.value_or(i) != i) continue;
    links_.push_back(LinkId{static_cast<std::uint8_t>(i)});
    world_.add_link(vehicle_, road_, links_.back(), o_.profiles[i].name,
                    emu::Link(o_.profiles[i], emu::link_seed(o_.seed, i)));
  }
  world_.on_event([this](HostId host, Event&& event) { on_event(host, std::move(event)); });
  const HostTimes& hosts = o_.hosts;
  const bool is_free = hosts.image_packets <= Duration{} && hosts.result_packets <= Duration{};
  if (o_.disturbances.empty() && is_free) return;
  world_.delay_with(
      [this](HostId from, const LeavingPacket& packet) { return delay_of(from, packet); });
}

void Offload::choose_top() {
  if (o_.top_level) {
    result_.top_level = *o_.top_level;
    return;
  }
  budget_.estimate(world_.endpoint(vehicle_).links(world_.local_time(vehicle_), peer_),
                   o_.hosts.encode, o_.variant_bytes.front(), o_.result_bytes);
  result_.top_level = roadside_.top_level(peer_, budget_.value());
}

void Offload::learn(const OffloadRound& round) {
  if (!o_.learns_budget || o_.top_level || round.done.outcome != Outcome::kRemote) return;
  const OffloadRound::AtRoad& road = *round.at_road;
  if (road.variant != 0) return;
  budget_.learn(round.done.e2e - (*road.ended - *road.began));
  result_.top_level = roadside_.top_level(peer_, budget_.value());
}

const Disturbance& Offload::disturbance(std::uint32_t round) const {
  static const Disturbance kNone;
  return round < o_.disturbances.size() ? o_.disturbances[round] : kNone;
}

double Offload::deviations(std::uint32_t round) {
  if (!o_.compute_noise) return 0;
  if (const auto& given = disturbance(round).deviations) return *given;
  return half_normal_deviations(unit_(rng_));
}

Duration Offload::runtime(std::size_t level, double deviations) const {
  return runtime_of(o_.ladder[level].median, o_.ladder[level].p95, deviations);
}

Duration Offload::delay_of(HostId from, const LeavingPacket& packet) const {
  if (!packet.round) return {};
  const Disturbance& d = disturbance(packet.round->round.value);
  if (from != vehicle_) return d.downlink + o_.hosts.result_packets;
  const Duration host = o_.hosts.image_packets;
  if (d.uplink.empty()) return host;
  return host + d.uplink[std::min<std::size_t>(packet.link.value, d.uplink.size() - 1)];
}

void Offload::begin(std::uint32_t number) {
  if (o_.road_step && o_.road_step->first == number) {
    world_.step_clock(road_, o_.road_step->second);
  }
  Endpoint& endpoint = world_.endpoint(vehicle_);
  const RoundRef ref = endpoint.begin_round(world_.local_time(vehicle_), kCamera);
  result_.rounds[number].round = number;
  result_.rounds[number].t0 = world_.now();
  world_.at(world_.now() + o_.hosts.encode, [this, ref] {
    Variants variants;
    for (const std::size_t bytes : o_.variant_bytes) variants.emplace_back(bytes);
    world_.endpoint(vehicle_).submit(world_.local_time(vehicle_), ref, std::move(variants),
                                     MessageClass::kData, peer_);
    world_.flush(vehicle_);
  });
  if (o_.local_backup) {
    world_.at(world_.now() + o_.hosts.encode + runtime(0, deviations(number)), [this, ref] {
      world_.endpoint(vehicle_).local_result(world_.local_time(vehicle_), ref,
                                             Bytes(o_.result_bytes));
      world_.flush(vehicle_);
    });
  }
  world_.flush(vehicle_);
}

void Offload::on_event(HostId host, Event&& event) {
  if (auto* done = std::get_if<RoundDone>(&event); done != nullptr && host == vehicle_) {
    OffloadRound& round = result_.rounds[done->round.round.value];
    ++round.answers;
    round.done = std::move(*done);
    round.done.result.clear();
    learn(round);
  } else if (auto* planned = std::get_if<Planned>(&event); planned != nullptr && host == vehicle_) {
    result_.rounds[planned->round.round.value].plan = std::move(planned->plan);
  } else if (auto* message = std::get_if<Delivered>(&event)) {
    delivered(std::move(*message));
  } else if (auto* change = std::get_if<PathChanged>(&event)) {
    result_.path_changes.push_back(std::move(*change));
  }
}

void Offload::delivered(Delivered message) {
  message.payload = {};
  const std::uint32_t number = message.round.round.value;
  // clang takes a nested class for not default-constructible within its own class.
  auto& road = result_.rounds[number].at_road.emplace(OffloadRound::AtRoad{});
  road.variant = message.variant;
  road.verdict = message.verdict;
  road.degraded = message.degraded;
  road.delivered = world_.now();
  const Unit::Job job{std::move(message), world_.local_time(road_), result_.top_level,
                      deviations(number)};
  const Duration before = disturbance(number).before_compute;
  if (before <= Duration{}) {
    roadside_.add(job);
    start_next();
    return;
  }
  world_.at(world_.now() + before, [this, job] {
    roadside_.add(job);
    start_next();
    world_.flush(road_);
  });
}

void Offload::start_next() {
  const TimePoint now = world_.local_time(road_);
  const Unit::Job* next = roadside_.next(now);
  if (next == nullptr) return;
  const std::uint32_t number = next->message.round.round.value;
  OffloadRound::AtRoad& record = *result_.rounds[number].at_road;
  record.began = world_.now();
  record.level = level_of(*next, result_.rounds[number]);
  const Unit::Job job = roadside_.begin(now, record.level);
  const Duration takes = runtime(record.level, job.input) + disturbance(number).inside_compute;
  world_.at(world_.now() + takes, [this] { computed(); });
}

std::size_t Offload::level_of(const Unit::Job& job, const OffloadRound& record) {
  if (!o_.level_rule) {
    return world_.endpoint(road_).begin_computation(world_.local_time(road_), job.message.round,
                                                    roadside_.levels(), job.top);
  }
  return o_.level_rule(record.round, record.at_road->delivered - record.t0,
                       *record.at_road->began - record.t0);
}

void Offload::computed() {
  const TimePoint now = world_.local_time(road_);
  const RoundRef round = roadside_.end(now).round;
  result_.rounds[round.round.value].at_road->ended = world_.now();
  world_.endpoint(road_).submit(now, round, {Bytes(o_.result_bytes)}, MessageClass::kResult);
  start_next();
  world_.flush(road_);
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
    round.feasible = clairvoyant_feasible(o_.profiles, processes, round.t0 + o_.hosts.encode,
                                          o_.deadline - o_.hosts.encode, o_.variant_bytes.back(),
                                          o_.result_bytes, o_.ladder.front().median);
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
  result_.up.resize(o_.profiles.size());
  result_.down.resize(o_.profiles.size());
  for (const LinkId link : links_) {
    result_.up[link.value] = world_.stats(link, true);
    result_.down[link.value] = world_.stats(link, false);
  }
  judge_feasibility();
  return std::move(result_);
}

}  // namespace

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
  keep_memory_of_frames();
  return Offload(options).run(prepare);
}

}  // namespace interneuron::sim
