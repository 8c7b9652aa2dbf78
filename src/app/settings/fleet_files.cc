#include "app/settings/fleet_files.h"

#include <unistd.h>

#include <cerrno>
#include <ctime>
#include <utility>

#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "app/settings/key_files.h"
#include "app/toml/toml_reader.h"
#include "core/secure/credential.h"

namespace interneuron::settings {
namespace {

namespace fs = std::filesystem;

// The longest list in base64 and the end of its line; one more shows that there is more.
constexpr std::size_t kMostRevocationCharacters = (kMaxRevocationsBytes + 2) / 3 * 4 + 3;

// The names of files are the user's, and may hold anything.
[[noreturn]] void refuse_signed(const fs::path& file, const std::string& what) {
  throw process::Failure(process::kConfiguration,
                         toml_reader::one_line("'" + file.string() + "' " + what));
}

[[noreturn]] void cannot_read_signed(const fs::path& file, int error) {
  throw process::Failure(
      process::is_of_the_system(error) ? process::kFailed : process::kConfiguration,
      toml_reader::one_line(process::file_problem("cannot read", file, error)));
}

// All that a file has, but no more than a list may have.
std::string text_in(int fd, const fs::path& file) {
  std::string text(kMostRevocationCharacters, '\0');
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t n = ::read(fd, text.data() + size, text.size() - size);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) cannot_read_signed(file, errno);
    if (n == 0) break;
    size += static_cast<std::size_t>(n);
  }
  text.resize(size);
  return text;
}

}  // namespace

std::optional<Bytes> read_signed_if_there(const fs::path& file) {
  const OwnFile opened = open_own_file(file, true);
  if (opened.error == ENOENT) return std::nullopt;
  if (opened.error != 0) cannot_read_signed(file, opened.error);
  if (!opened.problem.empty()) refuse_signed(file, opened.problem);
  const std::string text = text_in(opened.file.get(), file);
  std::string_view line(text);
  if (line.ends_with('\n')) line.remove_suffix(1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  auto bytes = crypto::parse_text(line);
  if (bytes && bytes->size() > kSignatureBytes) return bytes;
  refuse_signed(
      file,
      "holds nothing that an authority has signed: give one line of base64, as `interneuron "
      "keys sign` and `keys revoke` write");
}

Bytes read_signed(const fs::path& file) {
  if (auto bytes = read_signed_if_there(file)) return *bytes;
  refuse_signed(file, "is not there; `interneuron keys sign` and `keys revoke` make such files");
}

void write_signed(const fs::path& file, ByteView bytes) {
  process::write_whole(file, crypto::to_text(bytes) + "\n", 0644);
}

CredentialFile::CredentialFile(const fs::path& file, const PublicKey& own,
                               const std::vector<PublicKey>& authorities)
    : file_(file), bytes_(read_signed(file)) {
  const auto credential = authorities.empty() ? crypto::parse_credential(bytes_)
                                              : crypto::read_credential(bytes_, authorities);
  if (!credential && authorities.empty()) {
    refuse_signed(
        file, "holds no credential; give the file with what `interneuron keys sign` has printed");
  }
  if (!credential) {
    refuse_signed(
        file,
        "holds no credential that one of --authority has signed; `interneuron keys verify` "
        "looks at it");
  }
  if (credential->key != own) {
    refuse_signed(file, "is the credential of " + to_base64(credential->key) +
                            ", and this host is " + to_base64(own) +
                            "; give --key or --credential that fits");
  }
  credential_ = *credential;
}

std::string CredentialFile::problem(std::int64_t unix_s) const {
  if (crypto::is_valid_at(credential_, unix_s)) return "";
  const bool early = unix_s < credential_.not_before_s;
  return toml_reader::one_line(
      "the credential '" + file_.string() + "' " +
      (early ? "holds from " + date_text(credential_.not_before_s)
             : "has ended at " + date_text(credential_.not_after_s)) +
      " and gets this host in nowhere: let its key be signed again, or set the clock");
}

std::optional<SignedList> signed_list(ByteView list, const std::vector<PublicKey>& authorities) {
  const auto read = crypto::read_revocations(list, authorities);
  if (!read) return std::nullopt;
  return SignedList{read->issued_s, read->keys.size()};
}

RevocationsFile::RevocationsFile(const fs::path& file, std::vector<PublicKey> authorities)
    : file_(file), authorities_(std::move(authorities)) {
  auto list = read_signed_if_there(file);
  if (!list) return;
  const auto read = signed_list(*list, authorities_);
  if (!read) {
    refuse_signed(
        file,
        "holds no list of revocations that one of --authority has signed; let `interneuron keys "
        "revoke` make it anew");
  }
  list_ = std::move(*list);
  issued_s_ = read->issued_s;
}

std::string RevocationsFile::store(ByteView list) const {
  try {
    const auto given = signed_list(list, authorities_);
    if (!given) return "";
    // Somebody may have put a newer one there since the start.
    const auto now = read_signed_if_there(file_);
    const auto there = now ? signed_list(*now, authorities_) : std::nullopt;
    if (!there || there->issued_s < given->issued_s) write_signed(file_, list);
    return "";
  } catch (const process::Failure& failure) {
    return failure.what();
  }
}

std::string date_text(std::int64_t unix_s) {
  const std::time_t time = unix_s;
  std::tm parts{};
  char text[64];
  if (::gmtime_r(&time, &parts) == nullptr ||
      std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts) == 0) {
    return "a time that no calendar has";
  }
  return text;
}

}  // namespace interneuron::settings
