// Frames of the demo video with the boxes that an application gets of them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lab/report/page.h"

namespace interneuron::report {

// Empty, with the reason in `missing`, when video, recordings or ground truth are not there. Throws
// process::Failure (1) when a folder that the user named lacks them, or files are damaged.
std::vector<Picture> pictures(const std::optional<std::filesystem::path>& data, bool named,
                              std::string& missing);

}  // namespace interneuron::report
