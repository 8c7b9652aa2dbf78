#include "lab/load/run.h"

#include "lab/load/bottleneck.h"
#include "lab/load/fleet.h"
#include "lab/load/meter.h"

namespace interneuron::load {
namespace {

class Run {
 public:
  explicit Run(const Scenario& scenario);
  Row run(const std::function<void(sim::World&)>& prepare);

 private:
  void plan_messages();
  Duration begin() const { return kWarmUp; }
  Duration end() const { return kWarmUp + span_of(s_); }
  BottleneckPart measured_until(Duration end);

  const Scenario& s_;
  sim::World world_;
  Meter meter_;
  sim::CellId cell_;
  std::unique_ptr<Fleet> fleet_;
  CrossTraffic cross_;
};

Run::Run(const Scenario& scenario)
    : s_(scenario),
      world_(scenario.seed),
      meter_(scenario.vehicles, scenario.deadline, variant_bytes(scenario)),
      cell_(world_.add_cell(cell_of(scenario, begin()))),
      fleet_(make_fleet(scenario, world_, cell_, meter_)),
      cross_(scenario, world_, cell_) {}

void Run::plan_messages() {
  const std::vector<Duration> first = first_messages(s_);
  for (std::size_t v = 0; v < s_.vehicles; ++v) {
    for (Duration at = begin() + first[v]; at < end(); at += s_.period) {
      world_.at(at, [this, v] { fleet_->send(v, meter_.begin(v, world_.now())); });
    }
  }
}

BottleneckPart Run::measured_until(Duration end) {
  const Duration from = world_.now();
  world_.measure_cells();
  world_.run_until(end);
  const emu::Cell& cell = world_.cell(cell_);
  return {end - from, to_ms(cell.queue_time().quantile(0.99)), cell.utilisation(end)};
}

Row Run::run(const std::function<void(sim::World&)>& prepare) {
  if (prepare) prepare(world_);
  plan_messages();
  world_.at(begin() - kCrossBegins, [this] { cross_.start(); });
  world_.run_until(begin());
  const std::uint64_t cross_before = cross_.readable_bytes();
  Row row{.scenario = s_};
  std::optional<BottleneckPart> joining;
  const Duration joined = joining_time(s_);
  if (joined > Duration{}) joining = measured_until(begin() + joined);
  read_bottleneck(joining, measured_until(end()), row);
  const std::uint64_t cross_bytes = cross_.readable_bytes() - cross_before;
  world_.run_until(end() + s_.deadline);
  fleet_->collect();
  read_messages(s_, meter_, begin(), row);
  read_cross_traffic(s_, meter_, static_cast<double>(cross_bytes), row);
  return row;
}

}  // namespace

Row run(const Scenario& scenario, const std::function<void(sim::World&)>& prepare) {
  return Run(scenario).run(prepare);
}

}  // namespace interneuron::load
