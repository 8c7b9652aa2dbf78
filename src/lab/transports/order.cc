#include "lab/transports/order.h"

#include <algorithm>
#include <array>

#include "app/process/failure.h"
#include "app/records/json_file.h"

namespace interneuron::transports {
namespace {

namespace fs = std::filesystem;
using records::Json;

constexpr const char* kOrder = "order.json";
constexpr const char* kVehicles = "vehicles.json";
constexpr const char* kRoad = "road.json";
constexpr const char* kCross = "cross.json";

// By Kind.
constexpr std::array<std::string_view, 6> kKinds{"ours", "udp", "tcp", "mptcp", "fastdds", "srt"};

Kind kind_of(const std::string& name) {
  const auto it = std::ranges::find(kKinds, name);
  if (it != kKinds.end()) return static_cast<Kind>(it - kKinds.begin());
  throw process::Failure(process::kFailed, "an order names no transport that there is");
}

TransportKind datagrams_of(const std::string& name) {
  if (const auto kind = parse_transport_kind(name)) return *kind;
  throw process::Failure(process::kFailed, "an order names no way of datagrams that there is");
}

SecretKey key_of(const Json& json) {
  if (const auto key = parse_key(json.get<std::string>())) return SecretKey(*key);
  throw process::Failure(process::kFailed, "an order holds a key that is none");
}

// Reads a file by `parse`, which throws Json::exception when something is missing.
template <class Parse>
auto read(const fs::path& file, const Parse& parse) {
  const Json json = records::read_json(file);
  try {
    return parse(json);
  } catch (const Json::exception& error) {
    throw process::Failure(process::kFailed,
                           "'" + file.string() + "': not of this program: " + error.what());
  }
}

std::int64_t ns(TimePoint at) { return at.time_since_epoch().count(); }

Duration duration(const Json& json) { return Duration{json.get<std::int64_t>()}; }
TimePoint instant(const Json& json) { return TimePoint{duration(json)}; }

Json modem_json(const Modem& m) {
  return {{"nic", m.nic}, {"vehicle", m.vehicle_address}, {"road", m.road_address}};
}

Modem modem_of(const Json& json) { return {json.at("nic"), json.at("vehicle"), json.at("road")}; }

Json traffic_json(const Traffic& traffic) {
  const auto counts = [](const std::vector<Duration>& times) {
    Json out = Json::array();
    for (const Duration at : times) out.push_back(at.count());
    return out;
  };
  return {{"variant_bytes", traffic.variant_bytes}, {"deadline_ns", traffic.deadline.count()},
          {"period_ns", traffic.period.count()},    {"length_ns", traffic.length.count()},
          {"first_ns", counts(traffic.first)},      {"joins_ns", counts(traffic.joins)}};
}

Traffic traffic_of(const Json& json) {
  Traffic traffic;
  traffic.variant_bytes = json.at("variant_bytes").get<std::vector<std::size_t>>();
  traffic.deadline = duration(json.at("deadline_ns"));
  traffic.period = duration(json.at("period_ns"));
  traffic.length = duration(json.at("length_ns"));
  for (const Json& at : json.at("first_ns")) traffic.first.push_back(duration(at));
  for (const Json& at : json.value("joins_ns", Json::array())) {
    traffic.joins.push_back(duration(at));
  }
  return traffic;
}

}  // namespace

std::string_view name_of(Kind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

fs::path write_order(const Order& order) {
  Json modems = Json::array();
  for (const Modem& m : order.modems) modems.push_back(modem_json(m));
  Json cross = Json::array();
  for (const CrossFlow& flow : order.cross) {
    cross.push_back({{"control", flow.control}, {"modem", modem_json(flow.modem)}});
  }
  Json keys = Json::array();
  for (const SecretKey& key : order.keys) keys.push_back(to_base64(key.bytes()));
  records::write_json(order.folder / kOrder, {{"transport", name_of(order.transport.kind)},
                                              {"mode", order.transport.mode},
                                              {"datagrams", to_string(order.transport.datagrams)},
                                              {"traffic", traffic_json(order.traffic)},
                                              {"modems", modems},
                                              {"keys", keys},
                                              {"way_ns", order.way.count()},
                                              {"cross", cross},
                                              {"cross_lead_ns", order.cross_lead.count()}});
  return order.folder / kOrder;
}

Order read_order(const fs::path& file) {
  return read(file, [&file](const Json& json) {
    Order order;
    order.transport = {kind_of(json.at("transport")), json.at("mode"),
                       datagrams_of(json.at("datagrams"))};
    order.traffic = traffic_of(json.at("traffic"));
    for (const Json& m : json.at("modems")) order.modems.push_back(modem_of(m));
    for (const Json& flow : json.value("cross", Json::array())) {
      order.cross.push_back({flow.at("control"), modem_of(flow.at("modem"))});
    }
    order.cross_lead = duration(json.value("cross_lead_ns", Json(0)));
    for (const Json& key : json.value("keys", Json::array())) order.keys.push_back(key_of(key));
    order.folder = file.parent_path();
    order.way = duration(json.at("way_ns"));
    return order;
  });
}

void write_record(const Order& order, const VehiclesRecord& record) {
  Json begun = Json::array();
  for (const std::vector<TimePoint>& of_vehicle : record.begun) {
    Json& row = begun.emplace_back(Json::array());
    for (const TimePoint at : of_vehicle) row.push_back(ns(at));
  }
  records::write_json(
      order.folder / kVehicles,
      {{"cpu_ns", record.cpu.count()}, {"wire_bytes", record.wire_bytes}, {"begun_ns", begun}});
}

void write_record(const Order& order, const RoadRecord& record) {
  Json arrivals = Json::array();
  for (const Arrival& a : record.arrivals) {
    arrivals.push_back(Json::array({a.vehicle, a.number, a.variant, ns(a.at)}));
  }
  records::write_json(order.folder / kRoad, {{"cpu", record.cpu}, {"arrivals", arrivals}});
}

void write_record(const Order& order, const CrossRecord& record) {
  Json samples = Json::array();
  for (const CrossRecord::Sample& s : record.samples) {
    samples.push_back(Json::array({ns(s.at), s.bytes}));
  }
  records::write_json(order.folder / kCross, {{"samples", samples}});
}

std::uint64_t CrossRecord::bytes_between(TimePoint from, TimePoint to) const {
  const auto by = [this](TimePoint at) {
    const auto after = std::ranges::upper_bound(samples, at, {}, &Sample::at);
    return after == samples.begin() ? 0 : std::prev(after)->bytes;
  };
  return by(to) - by(from);
}

CrossRecord read_cross(const Order& order) {
  return read(order.folder / kCross, [](const Json& json) {
    CrossRecord out;
    for (const Json& s : json.at("samples")) out.samples.push_back({instant(s.at(0)), s.at(1)});
    return out;
  });
}

VehiclesRecord read_vehicles(const Order& order) {
  return read(order.folder / kVehicles, [](const Json& json) {
    VehiclesRecord out;
    out.cpu = duration(json.at("cpu_ns"));
    out.wire_bytes = json.at("wire_bytes");
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

}  // namespace interneuron::transports
