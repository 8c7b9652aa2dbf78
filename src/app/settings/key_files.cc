#include "app/settings/key_files.h"

#include <fcntl.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/toml/toml_reader.h"

namespace interneuron::settings {
namespace {

namespace fs = std::filesystem;

// A key and the end of its line, which may be of two characters; one more shows that there is more.
constexpr std::size_t kKeyCharacters = 44;
constexpr std::size_t kMostKeyCharacters = kKeyCharacters + 3;

constexpr const char* kForm =
    "holds no key: give one line of 44 characters of base64, as `interneuron keys gen` writes";

// The names of files are the user's, and may hold anything.
[[noreturn]] void fail(int code, const std::string& what) {
  throw process::Failure(code, toml_reader::one_line(what));
}

[[noreturn]] void refuse(const fs::path& file, const std::string& what) {
  fail(process::kConfiguration, "'" + file.string() + "' " + what);
}

[[noreturn]] void cannot_read(const fs::path& file, int error) {
  fail(process::is_of_the_system(error) ? process::kFailed : process::kConfiguration,
       process::file_problem("cannot read", file, error));
}

// Text that is erased when it goes.
class SecretText {
 public:
  ~SecretText() { ::explicit_bzero(text_.data(), text_.size()); }
  SecretText() = default;
  SecretText(const SecretText&) = delete;
  SecretText& operator=(const SecretText&) = delete;

  // Reads until the end, at most as much as a key has. Returns 0, or an errno.
  int read_from(int fd) {
    while (size_ < text_.size()) {
      const ssize_t n = ::read(fd, text_.data() + size_, text_.size() - size_);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return errno;
      if (n == 0) break;
      size_ += static_cast<std::size_t>(n);
    }
    return 0;
  }
  // Nothing where the text is no key, or one of zeros, which everybody knows.
  std::optional<SecretKey> key() const {
    std::string_view line(text_.data(), size_);
    if (line.ends_with('\n')) line.remove_suffix(1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    auto bytes = parse_key(line);
    if (!bytes) return std::nullopt;
    const SecretKey key(*bytes);
    ::explicit_bzero(bytes->data(), bytes->size());
    return key == SecretKey{} ? std::nullopt : std::optional(key);
  }

 private:
  std::array<char, kMostKeyCharacters> text_{};
  std::size_t size_ = 0;
};

SecretKey key_in(int fd, const std::string& name) {
  SecretText text;
  if (const int error = text.read_from(fd); error != 0) cannot_read(name, error);
  if (const auto key = text.key()) return *key;
  refuse(name, kForm);
}

io::FileDescriptor open_key(const fs::path& file) {
  OwnFile opened = open_own_file(file, false);
  if (opened.error == ENOENT) {
    refuse(file, "is not there; `interneuron keys gen --out " + file.string() + "` makes a key");
  }
  if (opened.error != 0) cannot_read(file, opened.error);
  if (!opened.problem.empty()) refuse(file, opened.problem);
  return std::move(opened.file);
}

// ~/.config/interneuron, which nobody else has to look into.
void make_default_folder(const fs::path& folder) {
  // If this fails, mkdir() fails as well and tells why.
  std::error_code ignored;
  fs::create_directories(folder.parent_path(), ignored);
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    fail(process::kFailed, process::file_problem("cannot make the folder", folder, errno));
  }
}

// 19 digits and the end of the line are all that 64 bits need.
constexpr std::size_t kMostTimeCharacters = 32;

// The year 2200: what is added while a program runs still fits into 64 bits.
constexpr std::int64_t kLatest = 7'258'118'400'000'000'000;

// The number that is the whole of a text.
std::optional<std::int64_t> time_in(std::string_view text) {
  if (text.ends_with('\n')) text.remove_suffix(1);
  std::int64_t value = 0;
  const char* end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || rest != end || value < 0 || value > kLatest) return std::nullopt;
  return value;
}

}  // namespace

fs::path default_key_file() {
  const auto folder = [](const char* variable) -> fs::path {
    const char* value = std::getenv(variable);
    // The XDG Base Directory Specification wants relative ones to be ignored.
    return value != nullptr && *value == '/' ? fs::path(value) : fs::path();
  };
  if (const fs::path config = folder("XDG_CONFIG_HOME"); !config.empty()) {
    return config / "interneuron/key";
  }
  const fs::path home = folder("HOME");
  return home.empty() ? fs::path() : home / ".config/interneuron/key";
}

fs::path default_authority_file() {
  const fs::path key = default_key_file();
  return key.empty() ? fs::path() : key.parent_path() / "authority";
}

void write_new_key(const fs::path& file, const SecretKey& key) {
  if (file == default_key_file() || file == default_authority_file()) {
    make_default_folder(file.parent_path());
  }
  const io::FileDescriptor out(
      ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (out.get() < 0 && errno == EEXIST) {
    fail(process::kFailed, "'" + file.string() +
                               "' is there already, and no key is overwritten; `interneuron keys "
                               "pub` shows its public key, --out FILE names another file");
  }
  if (out.get() < 0) fail(process::kFailed, process::file_problem("cannot write", file, errno));
  std::string line = to_base64(key.bytes()) + "\n";
  int error = process::write_all(out.get(), line);
  ::explicit_bzero(line.data(), line.size());
  // A key whose public half others have been told must not be gone after a power cut.
  if (error == 0 && ::fsync(out.get()) != 0) error = errno;
  if (error == 0) return;
  ::unlink(file.c_str());
  fail(process::kFailed, process::file_problem("cannot write", file, error));
}

std::string make_key(const fs::path& file) {
  const SecretKey key = random_key();
  write_new_key(file, key);
  return to_base64(public_key_of(key));
}

OwnFile open_own_file(const fs::path& file, bool may_be_read) {
  OwnFile out;
  // A pipe that nobody writes to would keep us waiting.
  out.file = io::FileDescriptor(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (out.file.get() < 0 || ::fstat(out.file.get(), &status) != 0) {
    out.error = errno;
    return out;
  }
  const mode_t others = S_IWGRP | S_IWOTH | (may_be_read ? 0 : S_IRGRP | S_IROTH);
  if (!S_ISREG(status.st_mode)) {
    out.problem = "is no regular file; give the file that `interneuron keys` wrote";
  } else if (status.st_uid != ::geteuid() && status.st_uid != 0) {
    out.problem = "belongs to user " + std::to_string(status.st_uid) +
                  "; it has to be yours or root's: use `chown`, or another file";
  } else if ((status.st_mode & others) != 0) {
    out.problem = std::string("can be ") + (may_be_read ? "" : "read or ") +
                  "written by others; `chmod 600 " + file.string() + "` ends that";
  }
  return out;
}

SecretKey read_key(const fs::path& file) { return key_in(open_key(file).get(), file.string()); }

SecretKey read_key_from_stdin() { return key_in(STDIN_FILENO, "the standard input"); }

OwnKey::OwnKey(const fs::path& file) : file_(open_key(file)), key_(key_in(file_.get(), file)) {
  // Not every file system has locks; then nothing tells of a second program.
  if (::flock(file_.get(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
  fail(process::kFailed, "the key '" + file.string() +
                             "' is in use by another program, and to its peers a key is one host; "
                             "make one more with `interneuron keys gen --out FILE` and give --key "
                             "FILE");
}

TimeFile::TimeFile(const std::filesystem::path& key) : file_(key.string() + ".time") {
  const OwnFile opened = open_own_file(file_, true);
  if (opened.error == ENOENT) return;
  const std::string begin = "the time in '" + file_.string() + "' does not count: ";
  if (opened.error != 0) problem_ = begin + std::strerror(opened.error);
  if (!opened.problem.empty()) problem_ = begin + "the file " + opened.problem;
  if (!problem_.empty()) return;
  std::array<char, kMostTimeCharacters> text{};
  const ssize_t size = ::read(opened.file.get(), text.data(), text.size());
  if (size > 0) stored_ = time_in({text.data(), static_cast<std::size_t>(size)});
  if (!stored_) problem_ = begin + "it is no number of nanoseconds; remove the file";
}

std::string TimeFile::store(std::int64_t unix_ns) const {
  try {
    process::write_whole(file_, std::to_string(unix_ns) + "\n");
    return "";
  } catch (const process::Failure& failure) {
    return failure.what();
  }
}

}  // namespace interneuron::settings
