#include "lab/bench/reports.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace interneuron::bench {
namespace {

using coding::ImageDriveRow;
using coding::ImageRow;

constexpr const char* kSchema = "interneuron.image_drives/1";

records::Json json_of(const coding::Answers& answers) {
  return {{"on_time", answers.on_time}, {"quality", records::rounded(answers.quality, 1e4)}};
}

records::Json json_of(const ImageRow& row) {
  return {{"images", row.images},         {"policy", row.policy},
          {"ours", json_of(row.ours)},    {"clairvoyant", json_of(row.clairvoyant)},
          {"by_variant", row.by_variant}, {"bytes", std::round(row.bytes)}};
}

// Over all drives: rounds on time in per cent, and the quality.
void print_mean(const std::vector<ImageDriveRow>& rows, std::size_t way) {
  double rounds = 0;
  coding::Answers ours;
  coding::Answers clairvoyant;
  const auto add = [](coding::Answers& to, const coding::Answers& one, std::size_t of) {
    to.on_time += one.on_time;
    to.quality += one.quality * static_cast<double>(of);
  };
  for (const ImageDriveRow& row : rows) {
    rounds += static_cast<double>(row.rounds);
    add(ours, row.rows[way].ours, row.rounds);
    add(clairvoyant, row.rows[way].clairvoyant, row.rounds);
  }
  fmt::print("{}: {:.2f} % on time and AP {:.4f}, a clairvoyant {:.2f} % and {:.4f}\n",
             rows.front().rows[way].images, 100 * static_cast<double>(ours.on_time) / rounds,
             ours.quality / rounds, 100 * static_cast<double>(clairvoyant.on_time) / rounds,
             clairvoyant.quality / rounds);
}

}  // namespace

records::Json json_of(const std::vector<ImageDriveRow>& rows, std::uint64_t seed) {
  records::Json out{{"schema", kSchema}, {"seed", seed}, {"rows", records::Json::array()}};
  for (const ImageDriveRow& row : rows) {
    records::Json ways = records::Json::array();
    for (const ImageRow& way : row.rows) ways.push_back(json_of(way));
    std::vector<double> mbit;
    for (const double one : row.mbit) mbit.push_back(records::rounded(one, 1e4));
    out["rows"].push_back(
        {{"drive", row.drive}, {"rounds", row.rounds}, {"mbit_up", mbit}, {"ways", ways}});
  }
  return out;
}

void print_table(const std::vector<ImageDriveRow>& rows) {
  std::size_t widest = 0;
  for (const ImageDriveRow& row : rows) widest = std::max(widest, row.drive.size());
  fmt::print(
      "{} rounds every {:.0f} ms, deadline {:.0f} ms; in time and mean AP of the answers, ours and "
      "a clairvoyant's, kB a round up:\n\n{:{}}{:>14}",
      rows.front().rounds, to_ms(coding::kDrivePeriod), to_ms(coding::kImageDeadline), "drive",
      widest, "Mbit/s up");
  for (const ImageRow& way : rows.front().rows) {
    fmt::print("{:>8}{:>7}{:>13}{:>7}{:>6}", way.images, "AP", "clairvoyant", "AP", "kB");
  }
  fmt::print("\n");
  for (const ImageDriveRow& row : rows) {
    fmt::print("{:{}}{:>14}", row.drive, widest,
               fmt::format("{:.1f} + {:.1f}", row.mbit.at(0), row.mbit.at(1)));
    for (const ImageRow& way : row.rows) {
      fmt::print("{:>8}{:>7.3f}{:>13}{:>7.3f}{:>6.0f}", way.ours.on_time, way.ours.quality,
                 way.clairvoyant.on_time, way.clairvoyant.quality, way.bytes / 1000);
    }
    fmt::print("\n");
  }
  fmt::print("\n");
  for (std::size_t way = 0; way < rows.front().rows.size(); ++way) print_mean(rows, way);
}

}  // namespace interneuron::bench
