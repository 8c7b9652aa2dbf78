// Folders that only their owner can enter. In one whose name others can guess, or can write to,
// another user could put files or links where a program is about to write. Thread-compatible.
#pragma once

#include <filesystem>
#include <string>

#include "node/io/file_descriptor.h"

namespace interneuron::process {

// Makes the folder, and those above it, with mode 0700. One that is there already has to be a
// folder of this user that no other can enter, and no symbolic link. Throws Failure (1) naming it.
void make_private_folder(const std::filesystem::path& folder);

// Tells a folder that a program uses from one that a killed program has left: the lock goes with
// its process. Never waits, never throws.
class FolderLock {
 public:
  FolderLock() = default;
  explicit FolderLock(const std::filesystem::path& folder);
  // False when somebody else has it, or the folder cannot be opened or is a symbolic link.
  bool held() const { return folder_.get() >= 0; }

 private:
  io::FileDescriptor folder_;
};

// A temporary folder, PURPOSE-XXXXXX in TMPDIR, whose name nobody can guess. The destructor removes
// it with all its files; what a program that was killed has left goes with the next folder of this
// user for the same purpose.
class PrivateFolder {
 public:
  // Throws Failure (1) naming the folder.
  explicit PrivateFolder(const std::string& purpose);
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  // Held as long as the program lives.
  FolderLock lock_;
};

}  // namespace interneuron::process
