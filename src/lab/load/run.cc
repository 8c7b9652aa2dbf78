#include "lab/load/run.h"

#include <algorithm>
#include <numeric>

#include "core/base/statistics.h"
#include "lab/emu/random.h"
#include "lab/load/meter.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kLink{0};
constexpr PipelineId kPipeline{0};
// For everybody to get to know each other and to measure the link.
constexpr Duration kWarmUp = 2s;
// The queue is looked at once in this time. No measurement behind this value: it only has to be
// short against the time that a message takes.
constexpr Duration kLook = 1ms;
// The way back is not under test: its rate only has to be far above what answers need.
constexpr DataRate kRateBack = DataRate::mbit(1000);
constexpr std::uint32_t kRoadSession = 0x524f4144;

class Run {
 public:
  explicit Run(const Scenario& scenario);
  Row run(const std::function<void(sim::World&)>& prepare);

 private:
  emu::LinkProfile profile() const;
  std::vector<std::size_t> variant_bytes() const;
  EndpointOptions vehicle_options(std::size_t vehicle) const;
  void plan_messages();
  void plan_dip();
  void send(std::size_t vehicle);
  void look();
  Duration begin() const { return kWarmUp; }
  Duration end() const { return kWarmUp + s_.length; }
  double capacity_bytes() const;
  std::optional<double> whole_after_ms() const;
  Row row() const;

  const Scenario& s_;
  sim::World world_;
  Meter meter_;
  std::vector<sim::HostId> vehicles_;
  std::vector<PeerId> peers_;
  sim::HostId road_ = 0;
  // What the queue would have taken to drain, at each look.
  std::vector<double> queue_ms_;
  std::uint64_t delivered_before_ = 0;
  std::uint64_t delivered_ = 0;
};

Run::Run(const Scenario& scenario)
    : s_(scenario),
      world_(scenario.seed),
      meter_(scenario.vehicles, scenario.deadline, variant_bytes()) {}

std::vector<std::size_t> Run::variant_bytes() const {
  if (s_.peer == Peer::kOursVariants) return {s_.message_bytes, s_.small_bytes};
  return {s_.message_bytes};
}

emu::LinkProfile Run::profile() const {
  emu::LinkProfile profile;
  profile.name = "bottleneck";
  profile.delay = emu::constant_delay(to_ms(2 * s_.one_way), 0);
  const auto bytes_in = [](DataRate rate, Duration time) {
    return static_cast<std::size_t>(static_cast<double>(rate.bits_per_second) / 8 *
                                    std::chrono::duration<double>(time).count());
  };
  profile.up.rate = s_.capacity;
  profile.up.queue_bytes = bytes_in(s_.capacity, s_.queue);
  profile.down.rate = kRateBack;
  profile.down.queue_bytes = bytes_in(kRateBack, s_.queue);
  return profile;
}

// Messages go one way: a round of them ends with the delivery, and nobody answers.
EndpointOptions Run::vehicle_options(std::size_t vehicle) const {
  PipelineConfig pipeline;
  pipeline.id = kPipeline;
  pipeline.stages = {StageKind::kCommunication, StageKind::kCommunication};
  pipeline.deadline = s_.deadline;
  pipeline.period = s_.period;
  pipeline.policy = s_.peer == Peer::kOursVariants ? "down_sampling" : "best_link";
  pipeline.guard = GuardKind::kPaper;
  pipeline.use_x = false;
  pipeline.use_handler = false;
  EndpointOptions options;
  options.session = SessionId{static_cast<std::uint32_t>(vehicle + 1)};
  options.pipelines = {pipeline};
  options.policies = builtin_policies();
  return options;
}

void Run::send(std::size_t vehicle) {
  meter_.begin(vehicle, world_.now());
  const sim::HostId host = vehicles_[vehicle];
  Endpoint& endpoint = world_.endpoint(host);
  const RoundRef round = endpoint.begin_round(world_.local_time(host), kPipeline);
  Variants variants;
  for (const std::size_t bytes : variant_bytes()) variants.emplace_back(bytes);
  endpoint.submit(world_.local_time(host), round, std::move(variants), MessageClass::kData,
                  peers_[vehicle]);
  world_.flush(host);
}

// Each vehicle begins at a phase of its own, for no transport is made for vehicles that all send at
// one instant.
void Run::plan_messages() {
  emu::RandomStream random(s_.seed);
  for (std::size_t v = 0; v < s_.vehicles; ++v) {
    const Duration phase{
        static_cast<std::int64_t>(random.uniform() * static_cast<double>(s_.period.count()))};
    for (Duration at = begin() + phase; at < end(); at += s_.period) {
      world_.at(at, [this, v] { send(v); });
    }
  }
}

void Run::plan_dip() {
  if (!s_.dip) return;
  const auto change = [this](Duration at, DataRate rate) {
    world_.at(at, [this, rate] {
      emu::LinkChange c;
      c.direction(emu::Direction::kUp).rate = rate;
      world_.change(world_.wire_of(kLink), c);
    });
  };
  change(begin() + s_.dip->at, s_.dip->rate);
  change(begin() + s_.dip->at + s_.dip->length, s_.capacity);
}

void Run::look() {
  const emu::LinkModel& up = world_.model(world_.wire_of(kLink)).up();
  const DataRate rate = up.params().rate;
  queue_ms_.push_back(to_ms(rate.transmit_time(up.waiting_bytes(world_.now()))));
  if (world_.now() + kLook < end()) world_.at(world_.now() + kLook, [this] { look(); });
}

double Run::capacity_bytes() const {
  const auto carried = [](DataRate rate, Duration time) {
    return static_cast<double>(rate.bits_per_second) / 8 *
           std::chrono::duration<double>(time).count();
  };
  if (!s_.dip) return carried(s_.capacity, s_.length);
  return carried(s_.capacity, s_.length - s_.dip->length) + carried(s_.dip->rate, s_.dip->length);
}

std::optional<double> Run::whole_after_ms() const {
  if (!s_.dip) return std::nullopt;
  const Duration back = begin() + s_.dip->at + s_.dip->length;
  for (const Meter::Message& m : meter_.messages(0)) {
    if (m.begun >= back && meter_.on_time(m) && m.variant == 0) return to_ms(m.begun - back);
  }
  return std::nullopt;
}

Row Run::row() const {
  Row row;
  row.scenario = s_;
  row.messages = meter_.count();
  row.missed = meter_.missed();
  row.degraded = meter_.degraded();
  row.age_p50_ms = to_ms(meter_.age(0.50));
  row.age_p99_ms = to_ms(meter_.age(0.99));
  const auto on_time = static_cast<double>(meter_.on_time_bytes());
  row.on_time_goodput_mbit = on_time * 8e-6 / std::chrono::duration<double>(s_.length).count();
  const double offered = static_cast<double>(row.messages * s_.message_bytes);
  const double carried = capacity_bytes() * payload_share(s_.message_bytes);
  row.of_possible = on_time / std::min(offered, carried);
  row.queue_p99_ms = percentile(queue_ms_, 0.99);
  row.utilisation = static_cast<double>(delivered_ - delivered_before_) / capacity_bytes();
  if (s_.vehicles > 1) row.jain = meter_.jain();
  row.whole_after_ms = whole_after_ms();
  return row;
}

Row Run::run(const std::function<void(sim::World&)>& prepare) {
  EndpointOptions road;
  road.session = SessionId{kRoadSession};
  road.policies = builtin_policies();
  road.accept_peers = true;
  road_ = world_.add_host(std::move(road));
  vehicles_.push_back(world_.add_host(vehicle_options(0)));
  world_.add_link(vehicles_[0], road_, kLink, "bottleneck", emu::Link(profile(), s_.seed));
  world_.on_event([this](sim::HostId host, Event&& event) {
    const auto* message = std::get_if<Delivered>(&event);
    if (message == nullptr || host != road_) return;
    meter_.arrived(message->round.origin.value - 1, message->round.round.value, message->variant,
                   world_.now());
  });
  if (prepare) prepare(world_);
  peers_.push_back(world_.connect(vehicles_[0], road_));
  plan_messages();
  plan_dip();
  world_.at(begin(), [this] {
    delivered_before_ = world_.stats(kLink, true).bytes_delivered;
    look();
  });
  world_.run_until(end());
  delivered_ = world_.stats(kLink, true).bytes_delivered;
  world_.run_until(end() + s_.deadline);
  return row();
}

}  // namespace

Row run(const Scenario& scenario, const std::function<void(sim::World&)>& prepare) {
  return Run(scenario).run(prepare);
}

}  // namespace interneuron::load
