// Files that are written whole or not at all, and the words for files that cannot be written or
// read.
//
// What is written goes into a new file beside the one that is meant and takes its place at the end,
// so nobody ever sees a part: a full disk, a limit or an interruption leaves what was there before.
// The new file's name cannot be guessed and is never followed, so a folder that others may write to
// is safe. A device or a pipe, such as /dev/stdout, is written as it comes. Thread-compatible.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "node/io/file_descriptor.h"

namespace interneuron::process {

// "WHAT 'FILE': No space left on device; make room there or name another folder": one line for an
// errno. WHAT is "cannot write" or the like.
std::string file_problem(const std::string& what, const std::filesystem::path& file, int error);
// Whether an errno speaks of this process or system rather than of the file: no more open files, no
// memory, an error of the device.
bool is_of_the_system(int error);

// Writes all bytes to a descriptor. Returns 0, or an errno.
int write_all(int fd, std::string_view bytes);

class WholeFile {
 public:
  // These throw Failure (1) that names the file and the reason.
  // `mode`: of the new file, less what the umask takes away.
  explicit WholeFile(const std::filesystem::path& file, mode_t mode = 0666);
  void append(std::string_view bytes);
  // Puts the file in its place.
  void commit();

  // Leaves what was there before, unless committed.
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

 private:
  void write_out();
  [[noreturn]] void fail(int error);

  std::filesystem::path file_;
  // The file that is written meanwhile; empty for a device and once it is in its place.
  std::filesystem::path partial_;
  io::FileDescriptor out_;
  std::string buffer_;
};

// The whole of a file at once.
void write_whole(const std::filesystem::path& file, std::string_view bytes, mode_t mode = 0666);
// Reads a file; throws Failure with this code, which names the file and the reason.
std::string read_whole(const std::filesystem::path& file, int code);

// Hands what was printed to the standard output over to the system. Throws Failure (1) when it, or
// anything printed before, could not be written: a full disk, for one. A reader that has seen
// enough and gone (EPIPE) is no failure.
void finish_stdout();

}  // namespace interneuron::process
