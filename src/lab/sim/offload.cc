#include "lab/sim/offload.h"

#include <algorithm>
#include <deque>
#include <map>
#include <new>
#include <random>

#include "core/plan/budget.h"
#include "core/wire/packet.h"
#include "core/wire/round_header.h"

namespace interneuron::sim {
namespace {

constexpr PipelineId kCamera{0};
constexpr double kP95OfNormal = 1.645;  // standard deviations

std::vector<LevelProfile> level_profiles(const std::vector<LevelRuntime>& ladder) {
  std::vector<LevelProfile> out;
  for (const LevelRuntime& level : ladder) {
    out.push_back({level.median, level.p95, level.quality});
  }
  return out;
}

// By default glibc gives the memory of a frame back to the system after each copy and takes it anew
// for the next one: a third of a run's time. Once a block of this size was freed it keeps smaller
// ones (mallopt(3), M_MMAP_THRESHOLD); the block itself is never touched.
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
        levels_(level_profiles(options.ladder)) {}

  OffloadResult run(const std::function<void(World&)>& prepare);

 private:
  struct Job {
    RoundRef round;
    double deviations = 0;
  };

  void build();
  PipelineConfig pipeline() const;
  void begin(std::uint32_t round);
  std::vector<std::size_t> submitted_bytes() const;
  void on_event(HostId host, Event&& event);
  void delivered(const Delivered& delivered);
  void start_next();
  std::size_t level_of(const RoundRef& round, const OffloadRound& record);
  void computed(const RoundRef& round);
  const Disturbance& disturbance(std::uint32_t round) const;
  double deviations(std::uint32_t round);
  Duration runtime(std::size_t level, double deviations) const;
  Duration delay_of(HostId from, LinkId link, ByteView datagram);
  void choose_top();
  void judge_feasibility();

  const OffloadOptions& o_;
  World world_;
  std::mt19937_64 rng_;
  std::normal_distribution<double> unit_{0.0, 1.0};
  std::vector<LevelProfile> levels_;
  HostId vehicle_ = 0;
  HostId road_ = 0;
  PeerId peer_{};
  std::vector<LinkId> links_;
  std::deque<Job> waiting_;  // for the roadside's one core
  bool road_is_busy_ = false;
  // Whose packets are delayed: the messages of disturbed rounds, by sender.
  std::map<std::pair<HostId, MessageId>, std::uint32_t> delayed_;
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
  pipeline.use_x = o_.use_x;
  pipeline.use_handler = o_.use_handler;
  pipeline.guard = o_.guard;
  pipeline.levels = levels_;
  pipeline.fallback = o_.fallback;
  return pipeline;
}

void Offload::build() {
  EndpointOptions vehicle;
  vehicle.session = SessionId{0x56454831};
  vehicle.pipelines = {pipeline()};
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
    if (o_.only_link.value_or(i) != i) continue;
    links_.push_back(LinkId{static_cast<std::uint8_t>(i)});
    world_.add_link(vehicle_, road_, links_.back(), o_.profiles[i].name,
                    emu::Link(o_.profiles[i], emu::link_seed(o_.seed, i)));
  }
  world_.on_event([this](HostId host, Event&& event) { on_event(host, std::move(event)); });
  if (o_.disturbances.empty()) return;
  world_.delay_with([this](HostId from, LinkId link, ByteView datagram) {
    return delay_of(from, link, datagram);
  });
}

std::vector<std::size_t> Offload::submitted_bytes() const {
  if (o_.only_variant) return {o_.variant_bytes.at(*o_.only_variant)};
  return o_.variant_bytes;
}

void Offload::choose_top() {
  if (o_.top_level) {
    result_.top_level = *o_.top_level;
    return;
  }
  const auto links = world_.endpoint(vehicle_).links(world_.local_time(vehicle_), peer_);
  const Duration budget =
      compute_budget(o_.deadline - kEncode, links, submitted_bytes().front(), o_.result_bytes);
  for (std::size_t level = 0; level < o_.ladder.size(); ++level) {
    if (o_.ladder[level].p95 <= budget) result_.top_level = level;
  }
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
  return runtime_of(levels_[level].median, levels_[level].p95, deviations);
}

// The first piece of a message opens with its round's header, and the pieces of a message leave in
// order.
Duration Offload::delay_of(HostId from, LinkId link, ByteView datagram) {
  const auto type = static_cast<wire::PacketType>(std::to_integer<std::uint8_t>(datagram[0]));
  if (type != wire::PacketType::kData) return {};
  const auto packet = wire::parse(datagram);
  if (!packet) return {};
  const std::pair key{from, packet->data.fragment.message};
  auto it = delayed_.find(key);
  if (it == delayed_.end() && packet->data.fragment.index == 0) {
    const auto header = wire::parse_round_header(packet->data.bytes);
    if (!header) return {};
    const std::uint32_t round = header->round.round.value;
    const Disturbance& d = disturbance(round);
    if (from == vehicle_ ? !d.uplink.empty() : d.downlink > Duration{}) {
      it = delayed_.emplace(key, round).first;
    }
  }
  if (it == delayed_.end()) return {};
  const Disturbance& d = disturbance(it->second);
  if (from != vehicle_) return d.downlink;
  return d.uplink[std::min<std::size_t>(link.value, d.uplink.size() - 1)];
}

void Offload::begin(std::uint32_t number) {
  if (o_.road_step && o_.road_step->first == number) {
    world_.step_clock(road_, o_.road_step->second);
  }
  Endpoint& endpoint = world_.endpoint(vehicle_);
  const RoundRef ref = endpoint.begin_round(world_.local_time(vehicle_), kCamera);
  result_.rounds[number].round = number;
  result_.rounds[number].t0 = world_.now();
  world_.at(world_.now() + kEncode, [this, ref] {
    Variants variants;
    for (const std::size_t bytes : submitted_bytes()) variants.emplace_back(bytes);
    world_.endpoint(vehicle_).submit(world_.local_time(vehicle_), ref, std::move(variants),
                                     MessageClass::kData, peer_);
    world_.flush(vehicle_);
  });
  if (o_.local_backup) {
    world_.at(world_.now() + kEncode + runtime(0, deviations(number)), [this, ref] {
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
  } else if (auto* planned = std::get_if<Planned>(&event); planned != nullptr && host == vehicle_) {
    result_.rounds[planned->round.round.value].plan = std::move(planned->plan);
  } else if (const auto* frame = std::get_if<Delivered>(&event); frame != nullptr) {
    delivered(*frame);
  } else if (auto* change = std::get_if<PathChanged>(&event)) {
    result_.path_changes.push_back(std::move(*change));
  }
}

void Offload::delivered(const Delivered& frame) {
  const std::uint32_t number = frame.round.round.value;
  // clang takes a nested class for not default-constructible within its own class.
  auto& road = result_.rounds[number].at_road.emplace(OffloadRound::AtRoad{});
  road.variant = frame.variant;
  road.verdict = frame.verdict;
  road.degraded = frame.degraded;
  road.delivered = world_.now();
  const Job job{frame.round, deviations(number)};
  const Duration before = disturbance(number).before_compute;
  if (before <= Duration{}) {
    waiting_.push_back(job);
    start_next();
    return;
  }
  world_.at(world_.now() + before, [this, job] {
    waiting_.push_back(job);
    start_next();
    world_.flush(road_);
  });
}

// The roadside has one core: computations wait for each other.
void Offload::start_next() {
  if (road_is_busy_ || waiting_.empty()) return;
  road_is_busy_ = true;
  const Job job = waiting_.front();
  waiting_.pop_front();
  const std::uint32_t number = job.round.round.value;
  OffloadRound& record = result_.rounds[number];
  record.at_road->began = world_.now();
  record.at_road->level = level_of(job.round, record);
  const Duration takes =
      runtime(record.at_road->level, job.deviations) + disturbance(number).inside_compute;
  world_.at(world_.now() + takes, [this, ref = job.round] { computed(ref); });
}

std::size_t Offload::level_of(const RoundRef& round, const OffloadRound& record) {
  if (!o_.level_rule) {
    return world_.endpoint(road_).begin_computation(world_.local_time(road_), round, levels_,
                                                    result_.top_level);
  }
  return o_.level_rule(record.at_road->delivered - record.t0, *record.at_road->began - record.t0);
}

void Offload::computed(const RoundRef& round) {
  result_.rounds[round.round.value].at_road->ended = world_.now();
  road_is_busy_ = false;
  world_.endpoint(road_).submit(world_.local_time(road_), round, {Bytes(o_.result_bytes)},
                                MessageClass::kResult);
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
    round.feasible =
        clairvoyant_feasible(o_.profiles, processes, round.t0 + kEncode, o_.deadline - kEncode,
                             o_.variant_bytes.back(), o_.result_bytes, o_.ladder.front().median);
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

std::vector<LevelRuntime> default_ladder() {
  using std::chrono::microseconds;
  return {{"L0", microseconds(7900), microseconds(9800), {0.136, 0.128}},
          {"L2", microseconds(18600), microseconds(23600), {0.348, 0.327}},
          {"L4", microseconds(43900), microseconds(46000), {0.396, 0.383}}};
}

double half_normal_deviations(double unit_normal) {
  constexpr double kMedianOfHalfNormal = 0.67;
  return std::abs(unit_normal) - kMedianOfHalfNormal;
}

Duration runtime_of(Duration median, Duration p95, double deviations) {
  const double sd = static_cast<double>((p95 - median).count()) / kP95OfNormal;
  const auto middle = static_cast<double>(median.count());
  return Duration{static_cast<std::int64_t>(std::max(middle + deviations * sd, 0.5 * middle))};
}

std::size_t bytes_on_wire(std::size_t message_bytes) {
  constexpr std::size_t kChunk = kMaxDatagramBytes - wire::kFragmentOverhead;
  const std::size_t bytes = message_bytes + wire::kRoundHeaderBytes;
  const std::size_t packets = (bytes + kChunk - 1) / kChunk;
  return bytes + packets * (wire::kFragmentOverhead + wire::kIpUdpOverhead);
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
  keep_memory_of_frames();
  return Offload(options).run(prepare);
}

bool clairvoyant_feasible(const std::vector<emu::LinkProfile>& profiles,
                          const std::vector<emu::DelayProcess*>& processes, Duration t0,
                          Duration deadline, std::size_t smallest_bytes, std::size_t result_bytes,
                          Duration fastest_compute) {
  Duration at_road = Duration::max();
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent = t0 + profiles[i].up.rate.transmit_time(bytes_on_wire(smallest_bytes));
    at_road = std::min(at_road, sent + processes[i]->at(sent).rtt / 2);
  }
  const Duration computed = at_road + fastest_compute;
  for (std::size_t i = 0; i < profiles.size(); ++i) {
    const Duration sent =
        computed + profiles[i].down.rate.transmit_time(bytes_on_wire(result_bytes));
    if (sent + processes[i]->at(sent).rtt / 2 <= t0 + deadline) return true;
  }
  return false;
}

}  // namespace interneuron::sim
