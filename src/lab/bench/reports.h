// What the commands of `bench` show of their rows: JSON (docs/schema), tables on stdout, pictures,
// and drives as files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "app/records/json_file.h"
#include "interneuron/node_options.h"
#include "lab/coding/drives.h"
#include "lab/coding/image_drives.h"
#include "lab/load/forecast.h"
#include "lab/load/run.h"
#include "lab/peers_testbed/comparison.h"

namespace interneuron::bench {

// What `bench load` shows of its rows: JSON (docs/schema/load.json), tables and a picture.
inline constexpr const char* kLoadSchema = "interneuron.load/1";

// `datagrams`: what those of our own nodes passed through on the testbed; nothing: virtual time.
records::Json load_json(const std::vector<load::Row>& rows, std::optional<TransportKind> datagrams);
// A table for each group, on stdout.
void print_load(const std::vector<load::Row>& rows);

// Throws Failure (2) unless plot_load() can write a file of this name: .svg, .png or none.
void require_picture(const std::string& plot);
// On-time goodput against offered load, a line per transport, and the queue beneath: a column for
// each scenario of the groups that raise the load by the rate or the size of messages. Throws
// Failure (1) that names the file, also without gnuplot.
void plot_load(const std::filesystem::path& file, const std::vector<load::Row>& rows);

// What `bench forecast` shows of its bins: JSON (docs/schema/forecast.json), tables and a picture.
inline constexpr const char* kForecastSchema = "interneuron.forecast/2";

// The predictions of a scenario, or of several together.
struct Judged {
  std::string scenario;
  std::vector<load::Bin> bins;
  double brier = 0;
  std::size_t messages = 0;
};

records::Json forecast_json(const std::vector<Judged>& judged, std::uint64_t first_seed,
                            std::uint64_t seeds);
// A table for each, on stdout.
void print_forecast(const std::vector<Judged>& judged);
// What happened against what was predicted, a panel for each, with three standard errors. Throws
// Failure (1) that names the file, also without gnuplot.
void plot_forecast(const std::filesystem::path& file, const std::vector<Judged>& judged);

// What `bench drives --images` shows of its rows: a table, or JSON (docs/schema/image_drives.json).
// Pure, but for stdout.
records::Json json_of(const std::vector<coding::ImageDriveRow>& rows, std::uint64_t seed);

// Requires at least one row.
void print_table(const std::vector<coding::ImageDriveRow>& rows);

// What `bench peers` shows of its rows: JSON (docs/schema/peers.json), tables and a picture.
inline constexpr const char* kPeersSchema = "interneuron.peers/1";

// `datagrams`: what those of our own nodes passed through.
records::Json peers_json(const peers_testbed::Compared& compared, TransportKind datagrams);
// A table for each scenario and size, on stdout: a line for each peer.
void print_peers(const peers_testbed::Compared& compared, TransportKind datagrams);

// Misses of every peer at each deadline, a panel for each scenario, and the bytes that it took: a
// row of panels for each size. Throws Failure (1) that names the file, also without gnuplot.
void plot_peers(const std::filesystem::path& file, const std::vector<peers_testbed::Row>& rows);

// Drives as files: a profile per modem (tc_profiles/), with its rates beside it in Mahimahi's
// format, so that the programs can drive over the very modems that `bench drives` judges.
//
// Writes NUMBER-1.toml, NUMBER-1-up.mahi, NUMBER-1-down.mahi, NUMBER-2.toml, … into the folder,
// which is made if it is not there. `from`: the command that they are from, for their first line.
// Throws Failure (1) naming the file.
void write_profiles(const coding::Drive& drive, std::uint64_t number, const std::string& from,
                    const std::filesystem::path& folder);

}  // namespace interneuron::bench
