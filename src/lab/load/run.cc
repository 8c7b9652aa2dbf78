#include "lab/load/run.h"

#include <algorithm>

#include "lab/emu/random.h"
#include "lab/foreign/segment.h"
#include "lab/load/fleet.h"
#include "lab/load/meter.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// For everybody to get to know each other and to measure the link; cross traffic begins a second
// before the messages.
constexpr Duration kWarmUp = 2s;
constexpr Duration kCrossBegins = 1s;
// A late vehicle has its share when it had this part of it over such a window, which is looked at
// in such steps. No measurement behind the window: it only has to hold some ten messages.
constexpr double kEnoughShare = 0.8;
constexpr Duration kShareWindow = 500ms;
constexpr Duration kShareStep = 10ms;

double bytes_in(DataRate rate, Duration time) {
  return static_cast<double>(rate.bits_per_second) / 8 *
         std::chrono::duration<double>(time).count();
}

double mbit_of(double bytes, Duration time) {
  return bytes * 8e-6 / std::chrono::duration<double>(time).count();
}

class Run {
 public:
  explicit Run(const Scenario& scenario);
  Row run(const std::function<void(sim::World&)>& prepare);

 private:
  emu::CellParams cell() const;
  void plan_messages();
  Duration begin() const { return kWarmUp; }
  Duration end() const { return kWarmUp + s_.length; }
  double capacity_bytes() const;
  // What the bottleneck could have carried of messages like these.
  double payload_capacity() const { return capacity_bytes() * payload_share(s_.message_bytes); }
  std::optional<double> whole_after_ms() const;
  std::optional<double> share_after_ms() const;
  void read_bottleneck(Row& row) const;
  void read_cross_traffic(Row& row, std::uint64_t bytes) const;
  void read_messages(Row& row) const;

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
      cell_(world_.add_cell(cell())),
      fleet_(make_fleet(scenario, world_, cell_, meter_)),
      cross_(scenario, world_, cell_) {}

emu::CellParams Run::cell() const {
  emu::CellParams cell;
  cell.rate = s_.capacity;
  cell.queue_bytes = emu::queue_bytes_of(s_.capacity, s_.queue);
  if (s_.codel) cell.codel.emplace();
  if (s_.dip) {
    const Duration falls = begin() + s_.dip->at;
    const emu::SteppedRate steps{
        {{{}, s_.capacity}, {falls, s_.dip->rate}, {falls + s_.dip->length, s_.capacity}}, {}};
    cell.trace = std::make_shared<const emu::SteppedRate>(steps);
  }
  return cell;
}

// Each vehicle begins at a phase of its own, for no transport is made for vehicles that all send at
// one instant.
void Run::plan_messages() {
  emu::RandomStream random(s_.seed);
  for (std::size_t v = 0; v < s_.vehicles; ++v) {
    const Duration phase{
        static_cast<std::int64_t>(random.uniform() * static_cast<double>(s_.period.count()))};
    const bool is_late = s_.late && v + 1 == s_.vehicles;
    const Duration first = begin() + phase + (is_late ? *s_.late : Duration{});
    for (Duration at = first; at < end(); at += s_.period) {
      world_.at(at, [this, v] { fleet_->send(v, meter_.begin(v, world_.now())); });
    }
  }
}

double Run::capacity_bytes() const {
  if (!s_.dip) return bytes_in(s_.capacity, s_.length);
  return bytes_in(s_.capacity, s_.length - s_.dip->length) + bytes_in(s_.dip->rate, s_.dip->length);
}

std::optional<double> Run::whole_after_ms() const {
  if (!s_.dip) return std::nullopt;
  const Duration back = begin() + s_.dip->at + s_.dip->length;
  for (const Meter::Message& m : meter_.messages(0)) {
    if (m.begun >= back && meter_.on_time(m) && m.variant == 0) return to_ms(m.begun - back);
  }
  return std::nullopt;
}

std::optional<double> Run::share_after_ms() const {
  const std::size_t last = s_.vehicles - 1;
  if (!s_.late || meter_.messages(last).empty()) return std::nullopt;
  const Duration first = meter_.messages(last).front().begun;
  const double share = bytes_in(s_.capacity, kShareWindow) * payload_share(s_.message_bytes) /
                       static_cast<double>(s_.vehicles);
  for (Duration at = first; at <= end(); at += kShareStep) {
    const auto had = static_cast<double>(meter_.on_time_bytes(last, at - kShareWindow, at));
    if (had >= kEnoughShare * share) return to_ms(at - first);
  }
  return std::nullopt;
}

void Run::read_bottleneck(Row& row) const {
  row.queue_p99_ms = to_ms(world_.cell(cell_).queue_time().quantile(0.99));
  row.utilisation = world_.cell(cell_).utilisation(world_.now());
}

void Run::read_cross_traffic(Row& row, std::uint64_t bytes) const {
  if (s_.cross_flows == 0) return;
  const auto parties = static_cast<double>(s_.vehicles + s_.cross_flows);
  const double own = payload_capacity() * static_cast<double>(s_.vehicles) / parties;
  const double cross = capacity_bytes() * foreign::kMss / (foreign::kMss + foreign::kTcpIpBytes) *
                       static_cast<double>(s_.cross_flows) / parties;
  row.own_share = static_cast<double>(meter_.on_time_bytes()) / own;
  row.cross_share = static_cast<double>(bytes) / cross;
}

void Run::read_messages(Row& row) const {
  row.messages = meter_.count();
  row.missed = meter_.missed();
  row.degraded = meter_.degraded();
  row.age_p50_ms = to_ms(meter_.age(0.50));
  row.age_p99_ms = to_ms(meter_.age(0.99));
  const auto on_time = static_cast<double>(meter_.on_time_bytes());
  row.on_time_goodput_mbit = mbit_of(on_time, s_.length);
  const auto offered = static_cast<double>(row.messages * s_.message_bytes);
  row.of_possible = on_time / std::min(offered, payload_capacity());
  if (s_.vehicles > 1) row.jain = meter_.jain();
  row.whole_after_ms = whole_after_ms();
  row.share_after_ms = share_after_ms();
}

Row Run::run(const std::function<void(sim::World&)>& prepare) {
  if (prepare) prepare(world_);
  plan_messages();
  world_.at(begin() - kCrossBegins, [this] { cross_.start(); });
  world_.run_until(begin());
  world_.measure_cells();
  const std::uint64_t cross_before = cross_.readable_bytes();
  world_.run_until(end());
  Row row;
  row.scenario = s_;
  read_bottleneck(row);
  const std::uint64_t cross_bytes = cross_.readable_bytes() - cross_before;
  world_.run_until(end() + s_.deadline);
  fleet_->collect();
  read_messages(row);
  read_cross_traffic(row, cross_bytes);
  return row;
}

}  // namespace

Row run(const Scenario& scenario, const std::function<void(sim::World&)>& prepare) {
  return Run(scenario).run(prepare);
}

}  // namespace interneuron::load
