// Drives as files: a profile per modem (tc_profiles/), with its rates beside it in Mahimahi's
// format, so that the programs can drive over the very modems that `bench drives` judges.
#pragma once

#include <filesystem>

#include "lab/coding/drives.h"

namespace interneuron::cli {

// Writes NUMBER-1.toml, NUMBER-1-up.mahi, NUMBER-1-down.mahi, NUMBER-2.toml, … into the folder,
// which is made if it is not there. `from`: the command that they are from, for their first line.
// Throws Failure (1) naming the file.
void write_profiles(const coding::Drive& drive, std::uint64_t number, const std::string& from,
                    const std::filesystem::path& folder);

}  // namespace interneuron::cli
