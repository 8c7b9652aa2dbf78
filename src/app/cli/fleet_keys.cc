#include "app/cli/commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "app/process/failure.h"
#include "app/settings/fleet_files.h"
#include "app/settings/key_files.h"
#include "app/settings/key_options.h"
#include "app/toml/toml_reader.h"
#include "core/secure/credential.h"
#include "node/io/steady_clock.h"

namespace interneuron::cli {
namespace {

constexpr std::int64_t kDayS = 24 * 60 * 60;
constexpr int kMaxDays = 3650;
// A credential that begins now is to hold at once where clocks are behind. No measurement behind
// it: hosts that synchronise theirs are within seconds.
constexpr std::int64_t kClocksBehindS = 60 * 60;
// As many as a list has room for.
constexpr std::size_t kMaxRevoked = (kMaxRevocationsBytes - kSignatureBytes - 12) / kKeyBytes;

std::int64_t now_s() { return io::unix_time_ns() / 1'000'000'000; }

PublicKey key_in(const std::string& text) { return *parse_key(text); }

// --- sign

struct SignOptions {
  std::string authority;
  std::string id;
  std::string role = "vehicle";
  int days = 90;
  std::string from;
  std::string key;
};

// Midnight UTC, or a time of that day.
std::optional<std::int64_t> parse_date(const std::string& text) {
  for (const char* form : {"%Y-%m-%d", "%Y-%m-%dT%H:%M:%SZ"}) {
    std::tm parts{};
    const char* end = ::strptime(text.c_str(), form, &parts);
    if (end == nullptr || *end != '\0') continue;
    const std::tm given = parts;
    const std::time_t time = ::timegm(&parts);
    // The 30th of February becomes another day.
    if (parts.tm_mday == given.tm_mday && time >= 0) return time;
  }
  return std::nullopt;
}

std::string mistake_in_date(const std::string& text) {
  if (parse_date(text)) return "";
  return toml_reader::one_line("'" + text +
                               "': give a day as 2027-01-31, or a time as 2027-01-31T12:00:00Z");
}

std::string mistake_in_name(const std::string& text) {
  const bool fits = !text.empty() && text.size() <= kNodeNameBytes &&
                    std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
  if (fits) return "";
  return toml_reader::one_line("'" + text +
                               "': give 1 to 16 letters, digits or signs, without spaces");
}

int sign(const SignOptions& options) {
  const SecretKey authority = settings::read_key(options.authority);
  Credential credential;
  credential.key = key_in(options.key);
  credential.role =
      options.role == to_string(NodeRole::kRoadside) ? NodeRole::kRoadside : NodeRole::kVehicle;
  credential.node = options.id;
  const std::int64_t from = options.from.empty() ? now_s() : *parse_date(options.from);
  credential.not_before_s = options.from.empty() ? from - kClocksBehindS : from;
  credential.not_after_s = from + options.days * kDayS;
  fmt::print(stderr, "{} {} until {}; for its --credential FILE:\n", options.role, options.id,
             settings::date_text(credential.not_after_s));
  fmt::print("{}\n", crypto::to_text(crypto::sign_credential(credential, authority)));
  return process::kFine;
}

void add_sign(CLI::App& keys, std::function<int()>& run) {
  auto o = std::make_shared<SignOptions>();
  CLI::App* c = keys.add_subcommand("sign", "Sign the key of a host, or sign it again");
  c->add_option("--authority", o->authority, "File with the authority's private key")
      ->type_name("FILE")
      ->required();
  c->add_option("--id", o->id, "Name of the host: up to 16 characters, without spaces")
      ->type_name("NAME")
      ->check(mistake_in_name)
      ->required();
  c->add_option("--role", o->role, "What it is: vehicle (may join roadside units), or roadside")
      ->capture_default_str()
      ->check(CLI::IsMember({"vehicle", "roadside"}));
  c->add_option("--days", o->days, "How long it holds, days")
      ->capture_default_str()
      ->check(CLI::Range(1, kMaxDays));
  c->add_option("--from", o->from,
                "When that begins, UTC: 2027-01-31, or 2027-01-31T12:00:00Z (default: now, and an "
                "hour less for clocks that are behind)")
      ->type_name("DATE")
      ->check(mistake_in_date);
  c->add_option("KEY", o->key, "Public key of the host, as `interneuron keys pub` prints it there")
      ->check(settings::mistake_in_key)
      ->required();
  c->callback([&run, o] { run = [o] { return sign(*o); }; });
}

// --- verify

struct VerifyOptions {
  std::vector<std::string> authorities;
  std::string file;
};

int tell(const Credential& credential, const std::string& file) {
  const std::string whose = fmt::format("credential of the {} {}", to_string(credential.role),
                                        toml_reader::one_line(credential.node));
  const std::int64_t now = now_s();
  if (!crypto::is_valid_at(credential, now)) {
    const bool early = now < credential.not_before_s;
    throw process::Failure(
        process::kFailed,
        toml_reader::one_line(fmt::format(
            "'{}' is the {}, which {} {}; `interneuron keys sign` renews it", file, whose,
            early ? "holds from" : "has ended at",
            settings::date_text(early ? credential.not_before_s : credential.not_after_s))));
  }
  fmt::print("{}\nkey {}\nfrom {}\nuntil {}\n", whose, to_base64(credential.key),
             settings::date_text(credential.not_before_s),
             settings::date_text(credential.not_after_s));
  return process::kFine;
}

int verify(const VerifyOptions& options) {
  std::vector<PublicKey> authorities;
  for (const std::string& text : options.authorities) authorities.push_back(key_in(text));
  const Bytes bytes = settings::read_signed(options.file);
  if (const auto credential = crypto::read_credential(bytes, authorities)) {
    return tell(*credential, options.file);
  }
  const auto list = crypto::read_revocations(bytes, authorities);
  if (!list) {
    throw process::Failure(
        process::kFailed,
        toml_reader::one_line("'" + options.file +
                              "' holds nothing that this authority has signed; give the "
                              "--authority that has, or sign it again"));
  }
  fmt::print("list of revocations of {}, {} {}\n", settings::date_text(list->issued_s),
             list->keys.size(), list->keys.size() == 1 ? "key" : "keys");
  for (const PublicKey& key : list->keys) fmt::print("{}\n", to_base64(key));
  return process::kFine;
}

void add_verify(CLI::App& keys, std::function<int()>& run) {
  auto o = std::make_shared<VerifyOptions>();
  CLI::App* c = keys.add_subcommand(
      "verify", "Tell what a credential or a list of revocations says, if an authority signed it");
  c->add_option("--authority", o->authorities, "Public key of the authority; once for each")
      ->type_name("KEY")
      ->check(settings::mistake_in_key)
      ->expected(1)
      ->take_all()
      ->required();
  c->add_option("FILE", o->file, "The file")->required();
  c->callback([&run, o] { run = [o] { return verify(*o); }; });
}

// --- revoke

struct RevokeOptions {
  std::string authority;
  std::string list;
  std::string replaces;
  std::vector<std::string> remove;
  std::vector<std::string> keys;
};

// The list in the file; an empty one where there is no file.
Revocations list_in(const RevokeOptions& options, const SecretKey& authority) {
  const auto bytes = settings::read_signed_if_there(options.list);
  if (!bytes) return {};
  std::vector<PublicKey> signers{crypto::authority_key_of(authority)};
  if (!options.replaces.empty()) signers.push_back(key_in(options.replaces));
  auto list = crypto::read_revocations(*bytes, signers);
  if (list) return std::move(*list);
  throw process::Failure(
      process::kConfiguration,
      toml_reader::one_line(
          "'" + options.list +
          "' holds no list that this authority has signed; name another --list, or "
          "--replaces KEY of the authority that has signed it"));
}

int revoke(const RevokeOptions& options) {
  const SecretKey authority = settings::read_key(options.authority);
  Revocations list = list_in(options, authority);
  for (const std::string& text : options.remove) {
    if (std::erase(list.keys, key_in(text)) > 0) continue;
    throw process::Failure(process::kFailed, "--remove: '" + options.list + "' does not name " +
                                                 text +
                                                 "; `interneuron keys verify` shows whom it names");
  }
  for (const std::string& text : options.keys) {
    if (!crypto::is_revoked(list, key_in(text))) list.keys.push_back(key_in(text));
  }
  if (list.keys.size() > kMaxRevoked) {
    throw process::Failure(process::kFailed,
                           fmt::format("a list has room for {} keys, and these are {}; --remove "
                                       "those whose credentials have ended",
                                       kMaxRevoked, list.keys.size()));
  }
  // Hosts take a list only if it is newer than theirs, whatever the clock of this one says.
  list.issued_s = std::max(now_s(), list.issued_s + 1);
  settings::write_signed(options.list, crypto::sign_revocations(list, authority));
  fmt::print("{}: {} {}, of {}\n", options.list, list.keys.size(),
             list.keys.size() == 1 ? "key" : "keys", settings::date_text(list.issued_s));
  return process::kFine;
}

void add_revoke(CLI::App& keys, std::function<int()>& run) {
  auto o = std::make_shared<RevokeOptions>();
  CLI::App* c = keys.add_subcommand(
      "revoke", "Add keys to a signed list of those that count no more, or make that list");
  c->add_option("--authority", o->authority, "File with the authority's private key")
      ->type_name("FILE")
      ->required();
  c->add_option("--list", o->list, "The signed list, which is made if it is not there")
      ->type_name("FILE")
      ->required();
  c->add_option("--replaces", o->replaces,
                "Public key of the authority that has signed the list until now, whose place this "
                "one takes")
      ->type_name("KEY")
      ->check(settings::mistake_in_key);
  c->add_option("--remove", o->remove, "Key to take off the list; once for each")
      ->type_name("KEY")
      ->check(settings::mistake_in_key)
      ->expected(1)
      ->take_all();
  c->add_option("KEY", o->keys,
                "Public keys that count no more; none: the list is signed again as it is, for "
                "those who want it new")
      ->check(settings::mistake_in_key);
  c->callback([&run, o] { run = [o] { return revoke(*o); }; });
}

}  // namespace

void add_fleet_keys(CLI::App& keys, std::function<int()>& run) {
  add_sign(keys, run);
  add_verify(keys, run);
  add_revoke(keys, run);
}

}  // namespace interneuron::cli
