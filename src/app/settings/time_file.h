// The time of day that a program has reached, in a file beside its key (FILE.time), for hosts
// without a clock that runs while they are off: peers refuse a handshake whose time is not after
// that of the one before, so a new life of the same key begins where the last one has ended. One
// line: ns since 1970. Never throws: without the file the clock alone counts. Thread-compatible.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace interneuron::settings {

class TimeFile {
 public:
  // Of this key.
  explicit TimeFile(const std::filesystem::path& key);

  // Nothing where none is stored, or none that counts.
  std::optional<std::int64_t> stored() const { return stored_; }
  // Why what the file says does not count; empty: it does, or there is none.
  const std::string& problem() const { return problem_; }
  // Writes the file whole or not at all. Returns why it could not be; empty: it was.
  std::string store(std::int64_t unix_ns) const;

 private:
  std::filesystem::path file_;
  std::optional<std::int64_t> stored_;
  std::string problem_;
};

}  // namespace interneuron::settings
