// Tells a file that is missing or wrong from a system that can open no file just now, which no
// fetching of files would help. Thread-safe.
#pragma once

#include <filesystem>
#include <string>

namespace interneuron::perception {

// For a file that could not be read, or is about to be. Throws std::runtime_error, one line that
// names it, the reason and the remedy, when it cannot be opened because this process or system has
// too many files open or no memory; returns in every other case.
void check_openable(const std::string& what, const std::filesystem::path& file);

}  // namespace interneuron::perception
