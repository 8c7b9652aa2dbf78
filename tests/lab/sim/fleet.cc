#include "tests/lab/sim/fleet.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <random>

#include "app/computing/roadside_unit.h"
#include "lab/sim/world.h"

namespace interneuron::sim {
namespace {

constexpr PipelineId kFleetCamera{0};
// After the last round has begun, until the run ends: several of an honest vehicle's deadlines.
constexpr Duration kRunOut = std::chrono::seconds(1);
// A result carries the level, and the vehicle and round that it is for, so that a mistake shows.
constexpr std::size_t kLevelAt = 0;
constexpr std::size_t kVehicleAt = 1;
constexpr std::size_t kRoundAt = 2;

class Fleet {
 public:
  explicit Fleet(const FleetOptions& options)
      : o_(options),
        world_(options.seed),
        rng_(options.seed ^ 0x9e3779b97f4a7c15ULL),
        unit_(profiles_of(options.ladder), std::nullopt, options.rules),
        outcomes_(options.vehicles.size()) {}

  std::vector<FleetOutcome> run();

 private:
  // An input is the number of the vehicle that sent it.
  using Unit = computing::RoadsideUnit<std::size_t>;

  void build();
  PipelineConfig pipeline(const FleetVehicle& vehicle) const;
  void begin(std::size_t vehicle);
  void begin_one(std::size_t vehicle);
  void on_event(HostId host, Event&& event);
  void done(std::size_t vehicle, const RoundDone& done);
  void told(std::size_t vehicle, const Message& message);
  void delivered(Delivered message);
  void start_next();
  void finish(bool readable);
  Bytes result_of(const computing::Computed& job) const;
  Duration runtime(std::size_t level);
  static SessionId session_of(std::size_t vehicle) {
    return SessionId{static_cast<std::uint32_t>(0x1000 + vehicle)};
  }

  const FleetOptions& o_;
  World world_;
  std::mt19937_64 rng_;
  std::normal_distribution<double> normal_{0.0, 1.0};
  Unit unit_;
  HostId road_ = 0;
  // The vehicles' hosts in their order, and the road's peer at each.
  std::vector<HostId> hosts_;
  std::vector<PeerId> road_at_;
  // How the unit knows each vehicle.
  std::map<std::size_t, PeerId> at_road_;
  std::vector<FleetOutcome> outcomes_;
  // When start_next() is called to end what is late.
  std::optional<TimePoint> timer_;
};

PipelineConfig Fleet::pipeline(const FleetVehicle& vehicle) const {
  return PipelineConfig{.id = kFleetCamera,
                        .stages = offload_stages(),
                        .deadline = vehicle.deadline,
                        .period = vehicle.period,
                        .policy = "down_sampling",
                        .guard = GuardKind::kBudget,
                        .levels = profiles_of(o_.ladder)};
}

void Fleet::build() {
  EndpointOptions road;
  road.session = SessionId{0x524f4144};
  road.policies = builtin_policies();
  road.accept_peers = true;
  road_ = world_.add_host(std::move(road));
  for (std::size_t i = 0; i < o_.vehicles.size(); ++i) {
    EndpointOptions options{.session = session_of(i),
                            .pipelines = {pipeline(o_.vehicles[i])},
                            .policies = builtin_policies()};
    hosts_.push_back(world_.add_host(std::move(options)));
    const LinkId link{static_cast<std::uint16_t>(i)};
    world_.add_link(hosts_[i], road_, link, o_.link.name,
                    emu::Link(o_.link, emu::link_seed(o_.seed, i)));
    road_at_.push_back(world_.connect(hosts_[i], road_));
  }
  world_.on_event([this](HostId host, Event&& event) { on_event(host, std::move(event)); });
}

Duration Fleet::runtime(std::size_t level) {
  const LevelRuntime& l = o_.ladder[level];
  return runtime_of(l.median, l.p95, half_normal_deviations(normal_(rng_)));
}

void Fleet::begin(std::size_t vehicle) {
  const FleetVehicle& v = o_.vehicles[vehicle];
  for (std::uint32_t i = 0; i < v.burst; ++i) begin_one(vehicle);
  world_.flush(hosts_[vehicle]);
}

void Fleet::begin_one(std::size_t vehicle) {
  const HostId host = hosts_[vehicle];
  Endpoint& endpoint = world_.endpoint(host);
  const RoundRef round = endpoint.begin_round(world_.local_time(host), kFleetCamera);
  ++outcomes_[vehicle].rounds;
  Variants variants;
  for (const std::size_t bytes : o_.vehicles[vehicle].variant_bytes) variants.emplace_back(bytes);
  endpoint.submit(world_.local_time(host), round, std::move(variants), MessageClass::kData,
                  road_at_[vehicle]);
  world_.at(world_.now() + runtime(0), [this, host, round] {
    world_.endpoint(host).local_result(world_.local_time(host), round, Bytes(1));
    world_.flush(host);
  });
}

void Fleet::on_event(HostId host, Event&& event) {
  if (host == road_) {
    if (auto* message = std::get_if<Delivered>(&event)) delivered(std::move(*message));
    return;
  }
  const auto vehicle = static_cast<std::size_t>(std::ranges::find(hosts_, host) - hosts_.begin());
  if (const auto* answer = std::get_if<RoundDone>(&event)) done(vehicle, *answer);
  if (const auto* message = std::get_if<Message>(&event)) told(vehicle, *message);
}

void Fleet::done(std::size_t vehicle, const RoundDone& done) {
  FleetOutcome& outcome = outcomes_[vehicle];
  if (done.outcome == Outcome::kLocal) {
    ++outcome.local;
    return;
  }
  ++outcome.on_time;
  outcome.levels.push_back(std::to_integer<std::size_t>(done.result.at(kLevelAt)));
  const bool own = std::to_integer<std::size_t>(done.result.at(kVehicleAt)) == vehicle;
  const bool this_round = done.result.at(kRoundAt) == std::byte(done.round.round.value & 0xFF);
  if (!own || !this_round) ++outcome.strange;
}

void Fleet::told(std::size_t vehicle, const Message& message) {
  const auto unanswered = computing::parse_no_answer(message.bytes);
  if (!unanswered) return;
  ++outcomes_[vehicle].told;
  if (unanswered->round.origin != session_of(vehicle)) ++outcomes_[vehicle].strange;
  const HostId host = hosts_[vehicle];
  world_.endpoint(host).give_up(world_.local_time(host), unanswered->round);
}

void Fleet::delivered(Delivered message) {
  const std::size_t vehicle = message.round.origin.value - session_of(0).value;
  at_road_[vehicle] = message.from;
  message.payload = {};
  const std::size_t top = unit_.top_level(message.from, o_.vehicles[vehicle].budget);
  unit_.add({std::move(message), world_.local_time(road_), top, vehicle});
  start_next();
}

void Fleet::start_next() {
  const TimePoint now = world_.local_time(road_);
  if (timer_ && *timer_ <= now) timer_.reset();
  if (const Unit::Job* next = unit_.next(now)) {
    const auto levels = unit_.levels(next->message.from, now);
    const std::size_t level = world_.endpoint(road_).begin_computation(
        now, next->message.round, levels, std::min(next->top, levels.size() - 1));
    const FleetVehicle& vehicle = o_.vehicles[next->input];
    unit_.begin(now, level);
    const Duration detecting = vehicle.readable ? runtime(level) : Duration{};
    world_.at(world_.now() + vehicle.decoding + detecting,
              [this, readable = vehicle.readable] { finish(readable); });
  }
  while (const auto unanswered = unit_.poll_unanswered()) {
    world_.endpoint(road_).send(now, unanswered->from, {computing::encode_no_answer(*unanswered)},
                                {.channel = computing::kNoAnswerChannel});
  }
  const auto due = unit_.next_timeout();
  if (!due || (timer_ && *timer_ <= *due)) return;
  timer_ = due;
  world_.at(world_.now() + (*due - now), [this] {
    start_next();
    world_.flush(road_);
  });
}

Bytes Fleet::result_of(const computing::Computed& job) const {
  Bytes result(kResultBytes);
  result[kLevelAt] = std::byte(job.level);
  result[kVehicleAt] = std::byte(job.round.origin.value - session_of(0).value);
  result[kRoundAt] = std::byte(job.round.round.value & 0xFF);
  return result;
}

void Fleet::finish(bool readable) {
  const TimePoint now = world_.local_time(road_);
  if (readable) {
    const computing::Computed job = unit_.end(now);
    world_.endpoint(road_).submit(now, job.round, {result_of(job)}, MessageClass::kResult,
                                  job.from);
  } else {
    unit_.fail(now);
  }
  start_next();
  world_.flush(road_);
}

std::vector<FleetOutcome> Fleet::run() {
  build();
  for (std::size_t i = 0; i < o_.vehicles.size(); ++i) {
    const FleetVehicle& v = o_.vehicles[i];
    for (Duration t = v.phase; t < o_.length; t += v.period) {
      world_.at(kWarmUp + t, [this, i] { begin(i); });
    }
  }
  world_.run_until(kWarmUp + o_.length + kRunOut);
  for (const auto& [vehicle, peer] : at_road_) outcomes_[vehicle].work = unit_.work(peer);
  return std::move(outcomes_);
}

}  // namespace

double FleetOutcome::mean_level() const {
  if (levels.empty()) return 0;
  const auto sum = std::accumulate(levels.begin(), levels.end(), std::size_t{0});
  return static_cast<double>(sum) / static_cast<double>(levels.size());
}

std::vector<FleetOutcome> run_fleet(const FleetOptions& options) { return Fleet(options).run(); }

}  // namespace interneuron::sim
