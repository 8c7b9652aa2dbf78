#include "app/process/private_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>

#include "app/process/failure.h"
#include "app/process/whole_file.h"

namespace interneuron::process {

namespace fs = std::filesystem;

void make_private_folder(const fs::path& folder) {
  // If this fails, mkdir() fails as well and tells why.
  std::error_code ignored;
  fs::create_directories(folder.parent_path(), ignored);
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw Failure(kFailed, file_problem("cannot make the folder", folder, errno));
  }
  struct stat status {};
  const bool there = ::lstat(folder.c_str(), &status) == 0;
  const bool ours = there && S_ISDIR(status.st_mode) && status.st_uid == ::geteuid() &&
                    (status.st_mode & (S_IRWXG | S_IRWXO)) == 0;
  if (!ours) {
    throw Failure(kFailed, "'" + folder.string() +
                               "' is no folder that only you can enter; remove it, or `chmod 700` "
                               "it if it is yours");
  }
}

FolderLock::FolderLock(const fs::path& folder)
    : folder_(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC)) {
  const bool locked = held() && ::flock(folder_.get(), LOCK_EX | LOCK_NB) == 0;
  if (!locked) folder_ = io::FileDescriptor();
}

namespace {

// A folder that is younger may have been made by a program that has yet to lock it. No measurement
// behind this value: it is long for two calls of the system, however busy that is.
constexpr std::chrono::minutes kYoung{1};

// Removes folders of this user for the same purpose whose programs have ended.
void remove_abandoned(const fs::path& parent, const std::string& purpose) {
  std::error_code ignored;
  for (fs::directory_iterator it(parent, ignored), end; it != end; it.increment(ignored)) {
    const fs::path folder = it->path();
    if (!folder.filename().string().starts_with(purpose + "-")) continue;
    struct stat status {};
    const bool ours = ::lstat(folder.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
                      status.st_uid == ::geteuid();
    const auto age = std::chrono::seconds(::time(nullptr) - status.st_mtime);
    if (!ours || age < kYoung) continue;
    const FolderLock lock(folder);
    if (lock.held()) fs::remove_all(folder, ignored);
  }
}

}  // namespace

PrivateFolder::PrivateFolder(const std::string& purpose) {
  std::error_code error;
  fs::path parent = fs::temp_directory_path(error);
  if (error) parent = "/tmp";
  remove_abandoned(parent, purpose);
  std::string name = (parent / (purpose + "-XXXXXX")).string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw Failure(kFailed, file_problem("cannot make a folder", name, errno) +
                               ", or set TMPDIR to a folder that can be written");
  }
  path_ = name;
  lock_ = FolderLock(path_);
}

PrivateFolder::~PrivateFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace interneuron::process
