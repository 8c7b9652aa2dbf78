// What `bench load` shows of its rows: JSON (docs/schema/load.json), tables and a picture.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "app/records/json_file.h"
#include "interneuron/node_options.h"
#include "lab/load/run.h"

namespace interneuron::cli {

inline constexpr const char* kLoadSchema = "interneuron.load/1";

// `datagrams`: what those of our own nodes passed through on the testbed; nothing: virtual time.
records::Json load_json(const std::vector<load::Row>& rows, std::optional<TransportKind> datagrams);
// A table for each group, on stdout.
void print_load(const std::vector<load::Row>& rows);

// Whether plot_load() can write a file of this name: .svg or .png.
bool is_picture(const std::filesystem::path& file);
// On-time goodput against offered load, a line per transport, and the queue beneath: a column for
// each scenario of the groups that raise the load by the rate or the size of messages. Throws
// Failure (1) that names the file, also without gnuplot.
void plot_load(const std::filesystem::path& file, const std::vector<load::Row>& rows);

}  // namespace interneuron::cli
