// What `bench peers` shows of its rows: JSON (docs/schema/peers.json), tables and a picture.
#pragma once

#include <filesystem>
#include <vector>

#include "app/records/json_file.h"
#include "lab/peers_testbed/series.h"

namespace interneuron::cli {

inline constexpr const char* kPeersSchema = "interneuron.peers/1";

// `datagrams`: what those of our own nodes passed through.
records::Json peers_json(const peers::Compared& compared, TransportKind datagrams);
// A table for each scenario and size, on stdout: a line for each peer.
void print_peers(const peers::Compared& compared, TransportKind datagrams);

// Misses of every peer at each deadline, a panel for each scenario, and the bytes that it took: a
// row of panels for each size. Throws Failure (1) that names the file, also without gnuplot.
void plot_peers(const std::filesystem::path& file, const std::vector<peers::Row>& rows);

}  // namespace interneuron::cli
