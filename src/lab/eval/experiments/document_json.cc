// How the file spells a document, in both directions.
#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>

#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/system_fields.h"

namespace interneuron::experiments {

// The keys of a document's parts and of the rows of rows.h, as system_fields.h has those of
// systems.

void fields(auto& f, Of<ClockRow> auto& r) {
  f("name", r.name);
  f("kind", r.kind);
  f("system", r.system);
  f("guard", r.guard);
  f("seeds", r.seeds);
  f("rounds", r.rounds);
  f("decided_differently", r.decided_differently);
  f("differ_at_all", r.differ_at_all);
  f("timeouts", r.timeouts);
  f("timeouts_at_offset_0", r.timeouts_at_offset_0);
  f("most_disturbed", r.most_disturbed);
}

void fields(auto& f, Of<Moments> auto& r) {
  f("avg", r.avg);
  f("min", r.min);
  f("max", r.max);
  f("std", r.std);
}

void fields(auto& f, Of<NetworkRow> auto& r) {
  f("name", r.name);
  f("seeds", r.seeds);
  f("pings", r.pings);
  f("lost", r.lost);
  f("rtt_ms", r.rtt_ms);
  f("drive_mean_sd_ms", r.drive_mean_sd_ms);
  f("paper_rtt_ms", r.paper_rtt_ms);
}

void fields(auto& f, Of<ApAr> auto& r) {
  f("ap", r.ap);
  f("ar", r.ar);
}

void fields(auto& f, Of<LevelRow> auto& r) {
  f("level", r.level);
  f("name", r.name);
  f("raw", r.raw);
  f("sampled", r.sampled);
  f("lost_by_sampling", r.lost_by_sampling);
  f("median_ms", r.median_ms);
  f("p95_ms", r.p95_ms);
}

void fields(auto& f, Of<TransmissionRow::Sent> auto& r) {
  f("mean", r.mean);
  f("p50", r.p50);
  f("p95", r.p95);
}

void fields(auto& f, Of<TransmissionRow> auto& r) {
  f("network", r.network);
  f("kilobytes", r.kilobytes);
  f("seeds", r.seeds);
  f("messages", r.messages);
  f("undelivered", r.undelivered);
  f("ms", r.ms);
}

void fields(auto& f, Of<ScriptRow::Road> auto& r) {
  f("theta1_ms", r.theta1_ms);
  f("theta2_ms", r.theta2_ms);
  f("d1_ms", r.d1_ms);
  f("image", r.image);
  f("level", r.level);
  f("d1_missed", r.d1_missed);
  f("at_d1", r.at_d1);
  f("d2_missed", r.d2_missed);
  f("marks", r.marks);
}

void fields(auto& f, Of<ScriptRow> auto& r) {
  f("round", r.round);
  f("on_time", r.on_time);
  f("theta3_ms", r.theta3_ms);
  f("x", r.x);
  f.part("theta1_ms", r.road);
}

void fields(auto& f, Of<LevelTimesRow> auto& r) {
  f("name", r.name);
  f("calibrated_ms", r.calibrated_ms);
  f("calibrated_p95_ms", r.calibrated_p95_ms);
  f("measured_ms", r.measured_ms);
  f("measured_p95_ms", r.measured_p95_ms);
}

void fields(auto& f, Of<Column> auto& r) {
  f("key", r.key);
  f("title", r.title);
  f("decimals", r.decimals);
  f.flag("percent", r.percent);
}

void fields(auto& f, Of<Series> auto& r) {
  f("name", r.name);
  f("unit", r.unit);
  f("points", r.points);
}

void fields(auto& f, Of<Waterfall::Send> auto& r) {
  f("link", r.link);
  f("direction", r.direction);
  f("what", r.what);
  f("fragments", r.fragments);
  f("sent_ms", r.sent_ms);
}

void fields(auto& f, Of<Waterfall> auto& r) {
  f("round", r.round);
  f("deadline_ms", r.deadline_ms);
  f("stages", r.stages);
  f("sends", r.sends);
}

namespace {

using records::Json;

template <class T>
constexpr bool kIsOptional = false;
template <class T>
constexpr bool kIsOptional<std::optional<T>> = true;
template <class T>
constexpr bool kIsVector = false;
template <class T>
constexpr bool kIsVector<std::vector<T>> = true;

// An object whose keys are data: the names of links.
using ByName = std::vector<std::pair<std::string, double>>;

constexpr std::array kClockFaults{"offset", "drift", "step"};

template <class T>
Json json_of(const T& value);
template <class T>
T value_of(const Json& json);

// Visitors of fields().
struct Writer {
  Json out = Json::object();

  void operator()(const char* key, const auto& value) { out[key] = json_of(value); }
  void flag(const char* key, bool value) {
    if (value) out[key] = true;
  }
  template <class T>
  void part(const char*, const std::optional<T>& value) {
    if (value) fields(*this, *value);
  }
};

struct Reader {
  const Json& in;

  template <class T>
  void operator()(const char* key, T& value) const {
    value = value_of<T>(in.at(key));
  }
  void flag(const char* key, bool& value) const { value = in.value(key, false); }
  template <class T>
  void part(const char* first_key, std::optional<T>& value) const {
    if (in.contains(first_key)) fields(*this, value.emplace(T{}));
  }
};

Json json_of_point(const Point& point) {
  if (!point.on_time) return {point.x, point.y};
  return {static_cast<std::uint32_t>(point.x), point.y, *point.on_time ? 1 : 0};
}

Point point_of(const Json& json) {
  Point out{json.at(0).get<double>(), json.at(1).get<double>(), std::nullopt};
  if (json.size() > 2) out.on_time = json.at(2) == 1;
  return out;
}

template <class T>
Json json_of(const T& value) {
  if constexpr (kIsOptional<T>) {
    return value ? json_of(*value) : Json(nullptr);
  } else if constexpr (std::is_same_v<T, Seeds>) {
    return {value.first, value.last};
  } else if constexpr (std::is_same_v<T, Point>) {
    return json_of_point(value);
  } else if constexpr (std::is_same_v<T, ClockFault>) {
    return kClockFaults.at(static_cast<std::size_t>(value));
  } else if constexpr (std::is_same_v<T, ByName>) {
    Json out = Json::object();
    for (const auto& [name, number] : value) out[name] = number;
    return out;
  } else if constexpr (kIsVector<T>) {
    Json out = Json::array();
    for (const auto& item : value) out.push_back(json_of(item));
    return out;
  } else if constexpr (std::is_constructible_v<Json, const T&>) {
    return Json(value);
  } else {
    Writer writer;
    fields(writer, value);
    return std::move(writer.out);
  }
}

ClockFault clock_fault_of(const std::string& name) {
  const auto found = std::ranges::find(kClockFaults, name);
  if (found == kClockFaults.end()) throw std::invalid_argument("no fault of a clock: " + name);
  return static_cast<ClockFault>(found - kClockFaults.begin());
}

template <class T>
T value_of(const Json& json) {
  if constexpr (kIsOptional<T>) {
    if (json.is_null()) return std::nullopt;
    return value_of<typename T::value_type>(json);
  } else if constexpr (std::is_same_v<T, Seeds>) {
    return {json.at(0).get<std::uint64_t>(), json.at(1).get<std::uint64_t>()};
  } else if constexpr (std::is_same_v<T, Point>) {
    return point_of(json);
  } else if constexpr (std::is_same_v<T, ClockFault>) {
    return clock_fault_of(json.get<std::string>());
  } else if constexpr (std::is_same_v<T, ByName>) {
    ByName out;
    for (const auto& [name, number] : json.items())
      out.emplace_back(name, number.template get<double>());
    return out;
  } else if constexpr (kIsVector<T>) {
    T out;
    for (const Json& item : json) out.push_back(value_of<typename T::value_type>(item));
    return out;
  } else if constexpr (std::is_constructible_v<Json, const T&>) {
    return json.get<T>();
  } else {
    T out;
    const Reader reader{json};
    fields(reader, out);
    return out;
  }
}

// Empty rows of the kind that this table of this experiment has.
Rows rows_like(const std::string& experiment, const std::string& table) {
  if (experiment == "table-network") return std::vector<NetworkRow>{};
  if (experiment == "fig-rt") return std::vector<ScriptRow>{};
  if (experiment == "ladder") return std::vector<LadderRow>{};
  if (experiment == "clock") return std::vector<ClockRow>{};
  if (experiment == "fig-adjust") {
    if (table == "transmission") return std::vector<TransmissionRow>{};
    return std::vector<LevelRow>{};
  }
  if (table == "paper") return std::vector<PaperRow>{};
  if (table == "agreement") return std::vector<AgreementRow>{};
  if (table == "levels") return std::vector<LevelTimesRow>{};
  return std::vector<SystemRow>{};
}

Json json_of_table(const Table& table) {
  return {{"name", table.name},
          {"title", table.title},
          {"about", table.about},
          {"columns", json_of(table.columns)},
          {"rows", rows_json(table.rows)}};
}

Table table_of(const std::string& experiment, const Json& json) {
  Table out{.name = json.at("name"),
            .title = json.at("title"),
            .about = json.at("about"),
            .columns = value_of<std::vector<Column>>(json.at("columns")),
            .rows = rows_like(experiment, json.at("name"))};
  std::visit([&](auto& rows) { rows = value_of<std::decay_t<decltype(rows)>>(json.at("rows")); },
             out.rows);
  return out;
}

}  // namespace

Json rows_json(const Rows& rows) {
  return std::visit([](const auto& of_kind) { return json_of(of_kind); }, rows);
}

Json to_json(const Document& document) {
  Json tables = Json::array();
  for (const Table& table : document.tables) tables.push_back(json_of_table(table));
  return {{"schema", kSchema},
          {"experiment", document.experiment},
          {"title", document.title},
          {"mode", document.mode},
          {"seeds", json_of(document.seeds)},
          {"rounds_per_seed", document.rounds_per_seed},
          {"tables", std::move(tables)},
          {"series", json_of(document.series)},
          {"waterfalls", json_of(document.waterfalls)},
          {"notes", document.notes}};
}

Document document_from(const Json& json) {
  if (json.at("schema") != kSchema) throw std::invalid_argument("another schema");
  Document out{.experiment = json.at("experiment"),
               .title = json.at("title"),
               .mode = json.at("mode"),
               .seeds = value_of<std::optional<Seeds>>(json.at("seeds")),
               .rounds_per_seed = json.at("rounds_per_seed"),
               .tables = {},
               .series = value_of<std::vector<Series>>(json.at("series")),
               .waterfalls = value_of<std::vector<Waterfall>>(json.at("waterfalls")),
               .notes = json.at("notes")};
  for (const Json& table : json.at("tables")) out.tables.push_back(table_of(out.experiment, table));
  return out;
}

}  // namespace interneuron::experiments
