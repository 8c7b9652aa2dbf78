// rounds.csv: one line per round. Each column is named, written and read in one place.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <exception>
#include <sstream>
#include <stdexcept>

#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/records/run_files.h"

namespace interneuron::records {
namespace {

// Milliseconds with microseconds, the unit of every time in our files.
std::string ms(Duration d) { return fmt::format("{:.3f}", to_ms(d)); }
// More than any round takes, and little enough that no conversion of it overflows: 31 years in ms.
constexpr double kMostMs = 1e12;
double number_from(const std::string& text) {
  const double value = std::stod(text);
  if (!(std::abs(value) <= kMostMs)) throw std::out_of_range(text);
  return value;
}
Duration from_text(const std::string& ms_text) { return from_ms(number_from(ms_text)); }
std::string flag(bool value) { return value ? "1" : "0"; }

std::string outcome_of(const RoundRow& r) {
  if (!r.answered) return "none";
  return r.outcome == Outcome::kRemote ? "remote" : "local";
}

RoundRow::Road& road_of(RoundRow& r) {
  if (!r.road) r.road = RoundRow::Road{};
  return *r.road;
}

// An empty field is what is not known of a round: it is written so, and read() is not called for
// it.
struct CsvColumn {
  const char* name;
  std::string (*write)(const RoundRow& r);
  void (*read)(RoundRow& r, const std::string& text);
};

// The text of a column that only a round with a remote result has.
template <auto kText>
std::string of_road(const RoundRow& r) {
  return r.road ? kText(*r.road) : "";
}

using Row = RoundRow;
using Road = RoundRow::Road;
using Text = const std::string&;

constexpr std::array<CsvColumn, 19> kColumns{{
    {"round", [](const Row& r) { return std::to_string(r.round); },
     [](Row& r, Text t) { r.round = static_cast<std::uint32_t>(std::stoul(t)); }},
    {"frame", [](const Row& r) { return std::to_string(r.frame); },
     [](Row& r, Text t) { r.frame = std::stoi(t); }},
    {"t0_ns", [](const Row& r) { return std::to_string(r.t0.time_since_epoch().count()); },
     [](Row& r, Text t) { r.t0 = TimePoint{Duration{std::stoll(t)}}; }},
    {"outcome", outcome_of,
     [](Row& r, Text t) {
       r.answered = t != "none";
       r.outcome = t == "remote" ? Outcome::kRemote : Outcome::kLocal;
     }},
    {"e2e_ms", [](const Row& r) { return ms(r.e2e); },
     [](Row& r, Text t) { r.e2e = from_text(t); }},
    {"age_rounds", [](const Row& r) { return r.age_rounds ? std::to_string(*r.age_rounds) : ""; },
     [](Row& r, Text t) { r.age_rounds = static_cast<std::uint32_t>(std::stoul(t)); }},
    {"x", [](const Row& r) { return fmt::format("{:.3f}", r.x_permille / 1000.0); },
     [](Row& r, Text t) {
       r.x_permille = static_cast<std::int16_t>(std::lround(number_from(t) * 1000));
     }},
    {"recovering", [](const Row& r) { return flag(r.recovering); },
     [](Row& r, Text t) { r.recovering = t == "1"; }},
    {"d2_missed", [](const Row& r) { return flag(r.degraded_final); },
     [](Row& r, Text t) { r.degraded_final = t == "1"; }},
    {"boxes", [](const Row& r) { return std::to_string(r.boxes); },
     [](Row& r, Text t) { r.boxes = std::stoul(t); }},
    {"variant", of_road<[](const Road& r) { return r.variant; }>,
     [](Row& r, Text t) { road_of(r).variant = t; }},
    {"level", of_road<[](const Road& r) { return std::to_string(r.level); }>,
     [](Row& r, Text t) { road_of(r).level = std::stoi(t); }},
    {"d1_missed", of_road<[](const Road& r) { return flag(r.late); }>,
     [](Row& r, Text t) { road_of(r).late = t == "1"; }},
    {"at_d1", of_road<[](const Road& r) { return flag(r.released); }>,
     [](Row& r, Text t) { road_of(r).released = t == "1"; }},
    {"overrun_ms", of_road<[](const Road& r) { return ms(r.overrun); }>,
     [](Row& r, Text t) { road_of(r).overrun = from_text(t); }},
    {"compute_ms", of_road<[](const Road& r) { return ms(r.compute); }>,
     [](Row& r, Text t) { road_of(r).compute = from_text(t); }},
    {"plan", [](const Row& r) { return r.plan; }, [](Row& r, Text t) { r.plan = t; }},
    {"possible", [](const Row& r) { return r.possible ? flag(*r.possible) : ""; },
     [](Row& r, Text t) { r.possible = t == "1"; }},
    {"guard", [](const Row& r) { return r.guard; }, [](Row& r, Text t) { r.guard = t; }},
}};

std::string header() {
  std::string out;
  for (const CsvColumn& column : kColumns)
    out += (out.empty() ? "" : ",") + std::string(column.name);
  return out;
}

// The fields of one line; none of ours holds a comma or a quote.
std::vector<std::string> fields(const std::string& line) {
  std::vector<std::string> out;
  std::stringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) out.push_back(field);
  if (!line.empty() && line.back() == ',') out.emplace_back();
  return out;
}

// Throws std::exception for a line that has other fields.
RoundRow row_of(const std::string& line) {
  const std::vector<std::string> texts = fields(line);
  if (texts.size() != kColumns.size()) throw std::invalid_argument("number of fields");
  RoundRow row;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (!texts[i].empty()) kColumns[i].read(row, texts[i]);
  }
  return row;
}

}  // namespace

CsvFile::CsvFile(const std::filesystem::path& file) : out_(file) { out_.append(header() + '\n'); }

void CsvFile::add(const RoundRow& row) {
  std::string line;
  for (const CsvColumn& column : kColumns) line += column.write(row) + ',';
  line.back() = '\n';
  out_.append(line);
}

void write_csv(const std::filesystem::path& file, const std::vector<RoundRow>& rows) {
  CsvFile out(file);
  for (const RoundRow& row : rows) out.add(row);
  out.commit();
}

std::vector<RoundRow> read_csv(const std::filesystem::path& file) {
  std::istringstream in(process::read_whole(file, process::kFailed));
  std::string line;
  if (!std::getline(in, line) || line != header()) {
    throw process::Failure(process::kFailed,
                           "'" + file.string() + "': not a rounds.csv of this version");
  }
  std::vector<RoundRow> rows;
  while (std::getline(in, line)) {
    try {
      rows.push_back(row_of(line));
    } catch (const std::exception&) {
      throw process::Failure(process::kFailed, "'" + file.string() + "': bad line '" + line + "'");
    }
  }
  return rows;
}

}  // namespace interneuron::records
