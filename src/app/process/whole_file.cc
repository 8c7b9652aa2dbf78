#include "app/process/whole_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <random>

#include "app/process/failure.h"

namespace interneuron::process {
namespace {

namespace fs = std::filesystem;

// What is appended is written in pieces of this size. No measurement behind this value: it only has
// to be much larger than a line.
constexpr std::size_t kPieceBytes = 64 * 1024;
// Names that are tried for the partial file. One is enough unless somebody guesses 64 random bits.
constexpr int kNames = 16;

const char* remedy(int error) {
  switch (error) {
    case ENOSPC:
    case EDQUOT:
      return "make room there or name another folder";
    case EMFILE:
    case ENFILE:
      return "too many are open: raise the limit with `ulimit -n`";
    case EACCES:
    case EPERM:
    case EROFS:
      return "choose one that you may use";
    case ENOENT:
    case ENOTDIR:
      return "choose a folder that exists";
    case EFBIG:
      return "raise the limit with `ulimit -f`";
    default:
      return "name another one";
  }
}

fs::path partial_name(const fs::path& file) {
  std::random_device random;
  return file.parent_path() /
         fmt::format(".{}.{:08x}{:08x}", file.filename().string(), random(), random());
}

bool is_device(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode);
}

// The file behind a symbolic link, so that the link stays what it is.
fs::path behind_links(const fs::path& file) {
  std::error_code error;
  if (!fs::is_symlink(file, error)) return file;
  const fs::path target = fs::weakly_canonical(file, error);
  return error ? file : target;
}

}  // namespace

std::string file_problem(const std::string& what, const fs::path& file, int error) {
  return fmt::format("{} '{}': {}; {}", what, file.string(), std::strerror(error), remedy(error));
}

bool is_of_the_system(int error) {
  return error == EMFILE || error == ENFILE || error == ENOMEM || error == EIO;
}

int write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
  return 0;
}

WholeFile::WholeFile(const fs::path& file, mode_t mode) : file_(behind_links(file)) {
  if (is_device(file_)) {
    out_ = io::FileDescriptor(::open(file_.c_str(), O_WRONLY | O_CLOEXEC));
    if (out_.get() < 0) fail(errno);
    return;
  }
  if (fs::is_directory(file_)) fail(EISDIR);
  int error = EEXIST;
  for (int i = 0; i < kNames && error == EEXIST; ++i) {
    const fs::path name = partial_name(file_);
    out_ = io::FileDescriptor(
        ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
    error = out_.get() < 0 ? errno : 0;
    if (error == 0) partial_ = name;
  }
  if (error != 0) fail(error);
}

WholeFile::~WholeFile() {
  if (!partial_.empty()) ::unlink(partial_.c_str());
}

void WholeFile::append(std::string_view bytes) {
  buffer_ += bytes;
  if (buffer_.size() >= kPieceBytes) write_out();
}

void WholeFile::write_out() {
  const int error = write_all(out_.get(), buffer_);
  buffer_.clear();
  if (error != 0) fail(error);
}

void WholeFile::commit() {
  write_out();
  if (partial_.empty()) return;
  if (::rename(partial_.c_str(), file_.c_str()) != 0) fail(errno);
  partial_.clear();
}

void WholeFile::fail(int error) {
  if (!partial_.empty()) ::unlink(partial_.c_str());
  partial_.clear();
  throw Failure(kFailed, file_problem("cannot write", file_, error));
}

void write_whole(const fs::path& file, std::string_view bytes, mode_t mode) {
  WholeFile out(file, mode);
  out.append(bytes);
  out.commit();
}

std::string read_whole(const fs::path& file, int code) {
  const io::FileDescriptor in(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  std::string text;
  std::array<char, kPieceBytes> piece;
  for (ssize_t n = in.get() < 0 ? -1 : 1; n != 0;) {
    if (n > 0) n = ::read(in.get(), piece.data(), piece.size());
    if (n < 0 && in.get() >= 0 && errno == EINTR) {
      n = 1;
      continue;
    }
    if (n < 0) {
      const int error = errno;
      throw Failure(is_of_the_system(error) ? kFailed : code,
                    file_problem("cannot read", file, error));
    }
    text.append(piece.data(), static_cast<std::size_t>(n));
  }
  return text;
}

void finish_stdout() {
  errno = 0;
  const bool flushed = std::fflush(stdout) == 0;
  if (flushed && std::ferror(stdout) == 0) return;
  // An earlier failure's reason is lost by now.
  const int error = errno;
  if (error == EPIPE) return;
  throw Failure(kFailed,
                fmt::format("cannot write to the standard output: {}; send it where there is room",
                            error != 0 ? std::strerror(error) : "an earlier write failed"));
}

}  // namespace interneuron::process
