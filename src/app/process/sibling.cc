#include "app/process/sibling.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "app/process/failure.h"

namespace interneuron::process {

namespace {

namespace fs = std::filesystem;

// Tells a sibling the version of the program that became it.
constexpr const char* kStarter = "INTERNEURON_STARTER_VERSION";

}  // namespace

const char* const kSiblings = INTERNEURON_SIBLINGS;

std::string own_program() {
  std::error_code error;
  const fs::path path = fs::read_symlink("/proc/self/exe", error);
  if (error) throw Failure(kFailed, "cannot find this program: " + error.message());
  return path;
}

std::string sibling_program(const std::string& name) {
  const fs::path folder = fs::path(own_program()).parent_path();
  const fs::path installed = (folder / kSiblings).lexically_normal();
  for (const fs::path& place : {folder, installed}) {
    const fs::path path = place / name;
    if (::access(path.c_str(), X_OK) == 0) return path;
  }
  throw Failure(
      kFailed,
      fmt::format("{} is not here, neither in {} nor in {}; install it, or build its target {}",
                  name, folder.string(), installed.string(), name));
}

void become_sibling(const std::string& name, const std::string& version, char** argv) {
  const std::string path = sibling_program(name);
  ::setenv(kStarter, version.c_str(), 1);
  ::execv(path.c_str(), argv);
  throw Failure(kFailed, fmt::format("cannot start {}: {}", path, std::strerror(errno)));
}

void refuse_other_version(const std::string& version) {
  const char* starter = std::getenv(kStarter);
  if (starter == nullptr) return;
  const std::string theirs = starter;
  ::unsetenv(kStarter);
  if (theirs == version) return;
  throw Failure(
      kFailed,
      fmt::format(
          "this is {} of version {}, started by interneuron {}; install both of one version",
          fs::path(own_program()).filename().string(), version, theirs));
}

}  // namespace interneuron::process
