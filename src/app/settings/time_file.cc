#include "app/settings/time_file.h"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>

#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/settings/key_files.h"

namespace interneuron::settings {
namespace {

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
