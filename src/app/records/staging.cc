#include "app/records/staging.h"

#include <cstdlib>
#include <string_view>
#include <system_error>
#include <vector>

#include "app/process/failure.h"
#include "app/records/run_files.h"

namespace interneuron::records {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kPrefix = ".partial-";
// Folders that are made until one can be locked; the last is used in any case.
constexpr int kTries = 4;

// What programs that were killed have left. The locks are held until it is gone, so that nobody
// begins to use it meanwhile.
void remove_abandoned(const fs::path& directory) {
  std::error_code ignored;
  std::vector<std::pair<fs::path, process::FolderLock>> abandoned;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, ignored)) {
    if (!entry.path().filename().string().starts_with(kPrefix)) continue;
    process::FolderLock lock(entry.path());
    if (lock.held()) abandoned.emplace_back(entry.path(), std::move(lock));
  }
  for (const auto& [folder, lock] : abandoned) fs::remove_all(folder, ignored);
}

}  // namespace

Staging::Staging(const fs::path& directory) : directory_(fs::absolute(directory)) {
  for (fs::path p = directory_; !fs::exists(p); p = p.parent_path()) made_ = p;
  make_directory(directory_);
  remove_abandoned(directory_);
  // Another program may take a new folder for an abandoned one until it is locked.
  for (int i = 0; i < kTries && !lock_.held(); ++i) {
    std::string name = (directory_ / (std::string(kPrefix) + "XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw process::Failure(process::kFailed, "output folder '" + directory.string() +
                                                   "': " + std::generic_category().message(errno) +
                                                   "; give another with --out DIR");
    }
    partial_ = name;
    lock_ = process::FolderLock(partial_);
  }
}

Staging::~Staging() {
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
  if (!made_.empty()) fs::remove_all(made_, ignored);
}

void Staging::publish() {
  for (const fs::directory_entry& file : fs::directory_iterator(partial_)) {
    std::error_code error;
    fs::rename(file.path(), directory_ / file.path().filename(), error);
    if (error) {
      throw process::Failure(process::kFailed, "cannot write '" +
                                                   (directory_ / file.path().filename()).string() +
                                                   "': " + error.message());
    }
  }
  made_.clear();
}

}  // namespace interneuron::records
