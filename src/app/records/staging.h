// Files that appear all at once in a folder, or not at all.
//
// They are written into a hidden folder inside, which is locked while its program runs. A program
// that is killed leaves it; the next one that writes to the same place removes it.
#pragma once

#include <filesystem>
#include <string>

#include "app/process/private_folder.h"

namespace interneuron::records {

// Makes `directory` when it is not there, and in it a folder for what is being written. The
// destructor removes that and, when nothing was published, the directories that it has made.
class Staging {
 public:
  // Throws process::Failure (1) naming the folder when it cannot be written to.
  explicit Staging(const std::filesystem::path& directory);
  ~Staging();
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  std::filesystem::path operator/(const std::string& name) const { return partial_ / name; }
  // Moves all files to the directory, in place of those of the same name. Throws process::Failure
  // (1).
  void publish();

 private:
  std::filesystem::path directory_;
  // The topmost directory that was not there; empty when all were.
  std::filesystem::path made_;
  std::filesystem::path partial_;
  // Held on partial_ while it is written.
  process::FolderLock lock_;
};

}  // namespace interneuron::records
