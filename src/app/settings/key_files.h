// Files that hold a key: one line of base64 (interneuron/security.h), as WireGuard has them.
// Whoever can read a private key is the host that it names. So a file is only used when it belongs
// to this user or to root, and nobody else may read or write it; the descriptor that is read from
// is the one that was looked at. Buffers that held a secret are erased. Thread-compatible.
//
// Functions throw Failure with one line that names the file and the remedy: 3 where the file is
// wrong, 1 where it cannot be written or the system fails.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "interneuron/security.h"
#include "node/io/file_descriptor.h"

namespace interneuron::settings {

// Where `keys gen` writes the key of this host, and where programs look that were given none:
// $XDG_CONFIG_HOME/interneuron/key, else ~/.config/interneuron/key. Empty where neither variable
// names a folder.
std::filesystem::path default_key_file();

// The same for the private key of a fleet authority: `authority` beside that key.
std::filesystem::path default_authority_file();

// Writes the key to a file that is not there yet, with mode 0600. The folder of default_key_file()
// is made if need be, no other one is.
void write_new_key(const std::filesystem::path& file, const SecretKey& key);
// Draws a key, writes it there and returns its public half, as an option takes it.
std::string make_key(const std::filesystem::path& file);

SecretKey read_key(const std::filesystem::path& file);
// From the standard input, whose reader has opened it: only what it holds is checked.
SecretKey read_key_from_stdin();

// The private key of a running program. The file is locked while this lives: to its peers a key is
// one host, and a second program with it would take the place of the first.
class OwnKey {
 public:
  explicit OwnKey(const std::filesystem::path& file);
  const SecretKey& key() const { return key_; }

 private:
  io::FileDescriptor file_;
  SecretKey key_;
};

// A file of this program that is open for reading, with what was found wrong with it; empty:
// nothing. `may_be_read`: by others, because it holds no secret.
struct OwnFile {
  io::FileDescriptor file;
  // The errno of opening it; 0: it is open.
  int error = 0;
  std::string problem;
};
OwnFile open_own_file(const std::filesystem::path& file, bool may_be_read);

// The time of day that a program has reached, in a file beside its key (FILE.time), for hosts
// without a clock that runs while they are off: peers refuse a handshake whose time is not after
// that of the one before, so a new life of the same key begins where the last one has ended. One
// line: ns since 1970. Never throws: without the file the clock alone counts.
class TimeFile {
 public:
  // `key`: the file of the key.
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
