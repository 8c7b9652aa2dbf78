#include "lab/peers_testbed/comparison.h"

#include "core/base/statistics.h"

namespace interneuron::peers_testbed {
namespace {

// What became of a message.
struct Fate {
  // Longer than any: it never came.
  Duration age = Duration::max();
  std::uint32_t variant = 0;
};

std::vector<Fate> fates_of(const std::vector<TimePoint>& begun,
                           const std::vector<transports::Arrival>& arrivals) {
  std::vector<Fate> out(begun.size());
  // The first that comes of a message counts.
  for (const transports::Arrival& a : arrivals) {
    if (a.vehicle != 0 || a.number >= out.size()) continue;
    Fate& fate = out[a.number];
    if (fate.age == Duration::max()) fate = {a.at - begun[a.number], a.variant};
  }
  return out;
}

std::optional<double> age_ms(const std::vector<Fate>& fates, double q) {
  std::vector<Duration> ages;
  for (const Fate& fate : fates) ages.push_back(fate.age);
  const Duration age = percentile(std::move(ages), q);
  return age == Duration::max() || fates.empty() ? std::nullopt : std::optional(to_ms(age));
}

double us(Duration time) { return 1e3 * to_ms(time); }

}  // namespace

std::vector<Row> rows_of(const Run& run, const transports::VehiclesRecord& vehicle,
                         const transports::RoadRecord& road) {
  const std::vector<Fate> fates =
      fates_of(vehicle.begun.empty() ? std::vector<TimePoint>{} : vehicle.begun[0], road.arrivals);
  std::vector<Row> out;
  for (const Duration deadline : run.deadlines) {
    Row row{run.scenario, run.peer, run.message_bytes, run.period(),
            deadline,     run.seed, fates.size()};
    for (std::size_t number = 0; number < fates.size(); ++number) {
      const Fate& fate = fates[number];
      const bool on_time = fate.age <= deadline;
      if (!on_time) row.missed_numbers.push_back(number);
      row.degraded += on_time && fate.variant > 0 ? 1 : 0;
    }
    row.missed = row.missed_numbers.size();
    row.p50_ms = age_ms(fates, 0.50);
    row.p99_ms = age_ms(fates, 0.99);
    if (!fates.empty()) {
      const auto messages = static_cast<double>(fates.size());
      row.wire_ratio = static_cast<double>(vehicle.wire_bytes) /
                       (messages * static_cast<double>(run.message_bytes));
      row.cpu_us_send = us(vehicle.cpu) / messages;
    }
    // What a message takes in the mean is the share of the time, times the time for each.
    if (road.arrivals.size() > 1) row.cpu_us_receive = road.cpu * us(run.period());
    out.push_back(row);
  }
  return out;
}

}  // namespace interneuron::peers_testbed
