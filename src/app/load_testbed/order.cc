#include "app/load_testbed/order.h"

#include "host/process/failure.h"
#include "lab/files/json_file.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;
using lab::Json;

constexpr const char* kOrder = "order.json";
constexpr const char* kVehicles = "vehicles.json";
constexpr const char* kRoad = "road.json";

// Reads a file by `parse`, which throws Json::exception when something is missing.
template <class Parse>
auto read(const fs::path& file, const Parse& parse) {
  const Json json = lab::read_json(file);
  try {
    return parse(json);
  } catch (const Json::exception& error) {
    throw Failure(kFailed, "'" + file.string() + "': not of this program: " + error.what());
  }
}

std::int64_t ns(TimePoint at) { return at.time_since_epoch().count(); }

TimePoint instant(const Json& json) { return TimePoint{Duration{json.get<std::int64_t>()}}; }

Json scenario_json(const load::Scenario& s) {
  return {{"peer", load::name_of(s.peer)},
          {"vehicles", s.vehicles},
          {"message_bytes", s.message_bytes},
          {"small_bytes", s.small_bytes},
          {"deadline_ns", s.deadline.count()},
          {"period_ns", s.period.count()},
          {"length_ns", s.length.count()},
          {"late_ns", s.late ? Json(s.late->count()) : Json(nullptr)},
          {"seed", s.seed}};
}

load::Scenario scenario_of(const Json& json) {
  load::Scenario s;
  const auto peer = load::peer_of(json.at("peer").get<std::string>());
  if (!peer) throw Failure(kFailed, "an order names no transport that there is");
  s.peer = *peer;
  s.vehicles = json.at("vehicles");
  s.message_bytes = json.at("message_bytes");
  s.small_bytes = json.at("small_bytes");
  s.deadline = Duration{json.at("deadline_ns").get<std::int64_t>()};
  s.period = Duration{json.at("period_ns").get<std::int64_t>()};
  s.length = Duration{json.at("length_ns").get<std::int64_t>()};
  if (!json.at("late_ns").is_null()) s.late = Duration{json.at("late_ns").get<std::int64_t>()};
  s.seed = json.at("seed");
  return s;
}

}  // namespace

fs::path write_order(const Order& order) {
  Json modems = Json::array();
  for (const Modem& m : order.modems) {
    modems.push_back({{"nic", m.nic}, {"vehicle", m.vehicle_address}, {"road", m.road_address}});
  }
  lab::write_json(order.folder / kOrder,
                  {{"scenario", scenario_json(order.scenario)}, {"modems", modems}});
  return order.folder / kOrder;
}

Order read_order(const fs::path& file) {
  return read(file, [&file](const Json& json) {
    Order order;
    order.scenario = scenario_of(json.at("scenario"));
    for (const Json& m : json.at("modems")) {
      order.modems.push_back({m.at("nic"), m.at("vehicle"), m.at("road")});
    }
    order.folder = file.parent_path();
    return order;
  });
}

void write_record(const Order& order, const VehiclesRecord& record) {
  Json begun = Json::array();
  for (const std::vector<TimePoint>& of_vehicle : record.begun) {
    Json& row = begun.emplace_back(Json::array());
    for (const TimePoint at : of_vehicle) row.push_back(ns(at));
  }
  lab::write_json(order.folder / kVehicles, {{"begun_ns", begun}});
}

void write_record(const Order& order, const RoadRecord& record) {
  Json arrivals = Json::array();
  for (const Arrival& a : record.arrivals) {
    arrivals.push_back(Json::array({a.vehicle, a.number, a.variant, ns(a.at)}));
  }
  lab::write_json(order.folder / kRoad, {{"cpu", record.cpu}, {"arrivals", arrivals}});
}

VehiclesRecord read_vehicles(const Order& order) {
  return read(order.folder / kVehicles, [](const Json& json) {
    VehiclesRecord out;
    for (const Json& row : json.at("begun_ns")) {
      std::vector<TimePoint>& of_vehicle = out.begun.emplace_back();
      for (const Json& at : row) of_vehicle.push_back(instant(at));
    }
    return out;
  });
}

RoadRecord read_road(const Order& order) {
  return read(order.folder / kRoad, [](const Json& json) {
    RoadRecord out;
    out.cpu = json.at("cpu");
    for (const Json& a : json.at("arrivals")) {
      out.arrivals.push_back({a.at(0), a.at(1), a.at(2), instant(a.at(3))});
    }
    return out;
  });
}

}  // namespace interneuron::cli
