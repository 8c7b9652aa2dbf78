// What `bench drives --images` shows of its rows: a table, or JSON (docs/schema/image_drives.json).
// Pure, but for stdout.
#pragma once

#include <cstdint>
#include <vector>

#include "app/records/json_file.h"
#include "lab/coding/image_drives.h"

namespace interneuron::cli {

records::Json json_of(const std::vector<coding::ImageDriveRow>& rows, std::uint64_t seed);

// Requires at least one row.
void print_table(const std::vector<coding::ImageDriveRow>& rows);

}  // namespace interneuron::cli
