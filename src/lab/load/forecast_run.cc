#include "lab/load/forecast.h"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "core/base/ablation.h"
#include "lab/emu/random.h"
#include "lab/load/bottleneck.h"
#include "lab/load/fleet.h"
#include "lab/sim/duo.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// Between two messages that are sent although they were refused. No measurement behind this value:
// it keeps them a small part of the load.
constexpr Duration kNeverthelessEvery = 250ms;
// How long after the last message what becomes of it is waited for, beyond the deadline.
constexpr Duration kAfter = 200ms;
constexpr LinkId kFirstLink{0};
constexpr PipelineId kPipeline{0};

// Plans as the policy of that name does and hands over at once what arrives, as plain messages are.
class AtOnce final : public Policy {
 public:
  explicit AtOnce(std::shared_ptr<const Policy> planner) : planner_(std::move(planner)) {}
  std::string_view name() const override { return "at_once"; }
  Plan plan(const Offer& offer, std::span<const LinkState> links,
            const Guidance& guidance) const override {
    return planner_->plan(offer, links, guidance);
  }
  Merge merge(const Arrival& /*arrival*/) const override { return Merge::kDeliver; }

 private:
  std::shared_ptr<const Policy> planner_;
};

PolicySet policies_of(Peer peer) {
  PolicySet out = builtin_policies();
  for (const auto& policy : builtin_policies()) {
    if (policy->name() == policy_of(peer)) out.push_back(std::make_shared<AtOnce>(policy));
  }
  return out;
}

class Trial {
 public:
  Trial(const ForecastScenario& scenario, bool nevertheless);
  // Plays it; then what was judged.
  std::vector<Forecast> run();
  // Whether a message was refused whose chance was told; requires run().
  bool has_refused() const { return has_refused_; }

 private:
  // What was predicted of a message, and whether it arrived in time.
  struct Note {
    Forecast forecast;
    Duration begun{};
    bool judged = false;
  };

  EndpointOptions vehicle_options() const;
  void join_profiles(sim::HostId vehicle, sim::HostId road);
  void plan_messages();
  void send(std::size_t vehicle);
  void send_nevertheless(std::size_t vehicle, std::uint32_t number);
  void arrived(const Bytes& bytes);

  const ForecastScenario& f_;
  const Scenario& s_;
  // Whether refused messages are the ones that are judged.
  bool nevertheless_;
  sim::World world_;
  sim::CellId cell_;
  CrossTraffic cross_;
  emu::RandomStream random_;
  OurHosts hosts_;
  // By the number that each message carries in its first bytes.
  std::vector<Note> notes_;
  bool has_refused_ = false;
  Duration next_nevertheless_{};
};

Trial::Trial(const ForecastScenario& scenario, bool nevertheless)
    : f_(scenario),
      s_(scenario.run),
      nevertheless_(nevertheless),
      world_(s_.seed),
      cell_(f_.profiles.empty() ? world_.add_cell(cell_of(s_, kWarmUp)) : sim::CellId{}),
      cross_(s_, world_, cell_),
      random_(s_.seed + 1),
      hosts_(s_, world_, vehicle_options(), [this](sim::HostId vehicle, sim::HostId road) {
        f_.profiles.empty() ? join(s_, world_, vehicle, road, kFirstLink, cell_)
                            : join_profiles(vehicle, road);
      }) {
  world_.on_event([this](sim::HostId host, Event&& event) {
    if (host != hosts_.road) return;
    if (const auto* message = std::get_if<Message>(&event)) arrived(message->bytes);
    if (const auto* round = std::get_if<Delivered>(&event)) arrived(round->payload);
  });
}

// The pipeline carries what is sent nevertheless: rounds are not refused.
EndpointOptions Trial::vehicle_options() const {
  PipelineConfig pipeline{.id = kPipeline,
                          .stages = {StageKind::kCommunication, StageKind::kCommunication},
                          .deadline = s_.deadline,
                          .period = s_.period,
                          .policy = "at_once",
                          .guard = GuardKind::kPaper};
  EndpointOptions options;
  options.pipelines = {pipeline};
  options.ablation =
      std::make_shared<const Ablation>(Ablation{.use_x = false, .use_handler = false});
  options.policies = policies_of(s_.peer);
  return options;
}

void Trial::join_profiles(sim::HostId vehicle, sim::HostId road) {
  for (std::size_t i = 0; i < f_.profiles.size(); ++i) {
    const auto profile = emu::built_in_profile(f_.profiles[i]);
    if (!profile) throw std::invalid_argument("no profile " + f_.profiles[i]);
    const LinkId link{static_cast<std::uint16_t>(kFirstLink.value + i)};
    world_.add_link(vehicle, road, link, profile->name,
                    emu::Link(*profile, emu::link_seed(s_.seed, i)));
  }
}

// Each vehicle begins at a phase of its own.
void Trial::plan_messages() {
  emu::RandomStream random(s_.seed);
  for (std::size_t v = 0; v < s_.vehicles; ++v) {
    const Duration phase{
        static_cast<std::int64_t>(random.uniform() * static_cast<double>(s_.period.count()))};
    const bool is_late = s_.late && v + 1 == s_.vehicles;
    const Duration first = kWarmUp + phase + (is_late ? *s_.late : Duration{});
    for (Duration at = first; at < kWarmUp + s_.length; at += s_.period) {
      world_.at(at, [this, v] { send(v); });
    }
  }
}

void Trial::send(std::size_t vehicle) {
  const auto number = static_cast<std::uint32_t>(notes_.size());
  const SendResult result = hosts_.send(vehicle, number);
  Note note;
  note.begun = world_.now();
  if (result.on_time) note.forecast.predicted = *result.on_time;
  note.forecast.second = static_cast<std::uint64_t>(world_.now() / 1s);
  note.forecast.refused = !result.accepted();
  note.judged = result.on_time && result.accepted() && !nevertheless_;
  notes_.push_back(note);
  if (result.on_time && !result.accepted()) {
    has_refused_ = true;
    if (nevertheless_) send_nevertheless(vehicle, number);
  }
  world_.flush(hosts_.vehicles[vehicle]);
}

void Trial::send_nevertheless(std::size_t vehicle, std::uint32_t number) {
  if (world_.now() < next_nevertheless_) return;
  // At random times, so that it is no more likely after a refusal than after many.
  next_nevertheless_ = world_.now() + Duration{static_cast<std::int64_t>(random_.exponential(
                                          static_cast<double>(kNeverthelessEvery.count())))};
  const sim::HostId host = hosts_.vehicles[vehicle];
  Endpoint& endpoint = world_.endpoint(host);
  const RoundRef round = endpoint.begin_round(world_.local_time(host), kPipeline);
  const SubmitStatus status =
      endpoint.submit(world_.local_time(host), round, hosts_.variants(number), MessageClass::kData,
                      hosts_.peers[vehicle]);
  notes_[number].judged = status == SubmitStatus::kAccepted;
}

void Trial::arrived(const Bytes& bytes) {
  Note& note = notes_.at(sim::number_of(bytes));
  if (world_.now() - note.begun <= s_.deadline) note.forecast.on_time = true;
}

std::vector<Forecast> Trial::run() {
  plan_messages();
  world_.at(kWarmUp - kCrossBegins, [this] { cross_.start(); });
  world_.run_until(kWarmUp + s_.length + s_.deadline + kAfter);
  std::vector<Forecast> out;
  for (const Note& note : notes_) {
    if (note.judged) out.push_back(note.forecast);
  }
  return out;
}

}  // namespace

std::vector<Forecast> forecasts(const ForecastScenario& scenario) {
  Trial as_it_is(scenario, false);
  std::vector<Forecast> out = as_it_is.run();
  // Without a refusal the second run would be the first.
  if (as_it_is.has_refused()) {
    const std::vector<Forecast> refused = Trial(scenario, true).run();
    out.insert(out.end(), refused.begin(), refused.end());
  }
  return out;
}

}  // namespace interneuron::load
