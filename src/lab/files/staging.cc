#include "lab/files/staging.h"

#include <cstdlib>
#include <system_error>

#include "host/process/failure.h"
#include "lab/files/run_files.h"

namespace interneuron::lab {
namespace fs = std::filesystem;

Staging::Staging(const fs::path& directory) : directory_(fs::absolute(directory)) {
  for (fs::path p = directory_; !fs::exists(p); p = p.parent_path()) made_ = p;
  make_directory(directory_);
  std::string name = (directory_ / ".partial-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw cli::Failure(cli::kFailed, "output folder '" + directory.string() +
                                         "': " + std::generic_category().message(errno) +
                                         "; give another with --out DIR");
  }
  partial_ = name;
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
      throw cli::Failure(cli::kFailed, "cannot write '" +
                                           (directory_ / file.path().filename()).string() +
                                           "': " + error.message());
    }
  }
  made_.clear();
}

}  // namespace interneuron::lab
