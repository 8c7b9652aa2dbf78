#include "app/settings/data.h"

#include <cstdlib>

#include "app/process/failure.h"

namespace interneuron::settings {
namespace fs = std::filesystem;

std::optional<fs::path> find_data(const std::string& given) {
  const char* variable = std::getenv("INTERNEURON_DATA");
  const std::string named = !given.empty() ? given : variable != nullptr ? variable : "";
  if (!named.empty()) {
    if (fs::is_directory(named)) return fs::absolute(named);
    throw process::Failure(
        process::kConfiguration,
        "data folder '" + named +
            "' does not exist; name another with --data or INTERNEURON_DATA, or run "
            "scripts/fetch_data.sh");
  }
  for (const char* candidate : {"../shared/data", "build/data"}) {
    if (fs::is_directory(candidate)) return fs::absolute(candidate);
  }
  return std::nullopt;
}

std::string default_video(const std::optional<fs::path>& data) {
  if (data && fs::is_regular_file(*data / "pets/vtest.avi")) return *data / "pets/vtest.avi";
  const fs::path packaged = "/usr/share/doc/opencv-doc/examples/data/vtest.avi";
  if (fs::is_regular_file(packaged)) return packaged;
  throw process::Failure(
      process::kConfiguration,
      "no video: run scripts/fetch_data.sh, or name one with --video FILE, FOLDER or camera:N");
}

std::optional<fs::path> default_truth(const std::optional<fs::path>& data) {
  if (data && fs::is_regular_file(*data / "pets/gt.txt")) return *data / "pets/gt.txt";
  return std::nullopt;
}

}  // namespace interneuron::settings
