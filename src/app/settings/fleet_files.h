// Files with what a fleet authority has signed (core/secure/credential.h): one line of base64 each,
// as `interneuron keys sign` and `keys revoke` write them. They hold no secret, but whoever writes
// to one can put an old list in the place of a new one; so a file has to belong to this user or to
// root, and nobody else may write to it. Thread-compatible.
//
// Functions throw Failure with one line that names the file and the remedy: 3 where the file is
// wrong, 1 where it cannot be written or the system fails.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/security.h"
#include "interneuron/units.h"

namespace interneuron::settings {

// The signed bytes that the file holds, whoever has signed them; nothing where there is no file.
std::optional<Bytes> read_signed_if_there(const std::filesystem::path& file);
Bytes read_signed(const std::filesystem::path& file);
// Writes the file whole or not at all; others may read it.
void write_signed(const std::filesystem::path& file, ByteView bytes);

// The credential that this host shows, which has to be for this key. Where authorities are known,
// one of them must have signed it.
class CredentialFile {
 public:
  CredentialFile(const std::filesystem::path& file, const PublicKey& own,
                 const std::vector<PublicKey>& authorities);
  const Bytes& bytes() const { return bytes_; }
  // What is to be told of it at this time; empty: it holds. The clock may be wrong, and those who
  // are shown it have clocks of their own.
  std::string problem(std::int64_t unix_s) const;

 private:
  std::filesystem::path file_;
  Bytes bytes_;
  Credential credential_;
};

// What a list of revocations says in short; nothing where none of the authorities has signed it.
struct SignedList {
  std::int64_t issued_s = 0;
  std::size_t keys = 0;
};
std::optional<SignedList> signed_list(ByteView list, const std::vector<PublicKey>& authorities);

// The newest list of revocations that a host knows, kept for its next start. None need be there at
// first.
class RevocationsFile {
 public:
  // Reads the file; one of the authorities must have signed it.
  RevocationsFile(const std::filesystem::path& file, std::vector<PublicKey> authorities);
  // Signed; empty: there was none.
  const Bytes& list() const { return list_; }
  // 0: there was none.
  std::int64_t issued_s() const { return issued_s_; }
  // Stores a newer list, unless the file has a newer one by now. Returns why it could not be
  // stored; empty: it was.
  std::string store(ByteView list) const;

 private:
  std::filesystem::path file_;
  std::vector<PublicKey> authorities_;
  Bytes list_;
  std::int64_t issued_s_ = 0;
};

// "2027-01-31T12:00:00Z"; "a time that no calendar has" where there is none.
std::string date_text(std::int64_t unix_s);

}  // namespace interneuron::settings
