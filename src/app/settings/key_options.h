// Who a program is and whom it believes, on the command line and in the configuration file:
//
//   --key FILE                      our private key (key_files.h)
//   --peer-key KEY[,psk=FILE]       of a program that connects: who the roadside unit is
//   --trust KEY[,psk=FILE]          of one that serves: each host that may come
//   --insecure                      no keys, packets in the clear
//   --authority KEY                 whoever shows a credential of this authority may come too, and
//                                   its lists of revocations count
//   --credential FILE               of one that connects: ours (fleet_files.h)
//   --revocations FILE              the newest list, and where newer ones of peers are kept
//   --revocations-max-age DAYS      of one that serves: how old the list may be
//   --revocations-stale WHAT        refuse or accept whom authorities have signed when it is older
//
// KEY is a public key as `interneuron keys pub` prints it, psk=FILE a key that both ends share in
// advance. Functions throw Failure with one line that names the thing and the remedy: 2 for a
// mistake in an option, 3 where a key is missing or its file is wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/settings/fleet_files.h"
#include "app/settings/key_files.h"
#include "interneuron/node_options.h"

namespace interneuron::settings {

// Whether the program connects to one host or serves any that it trusts.
enum class Trusts { kThePeer, kMany };

struct KeyOptions {
  // A file; empty: default_key_file().
  std::string key = {};
  // Each as --peer-key or --trust gives it.
  std::vector<std::string> trusted = {};
  bool insecure = false;
  // Public keys.
  std::vector<std::string> authorities = {};
  // Files; empty: none.
  std::string credential = {};
  std::string revocations = {};
  // 0: any age.
  int revocations_max_age_days = 0;
  // "refuse" or "accept"; empty: refuse.
  std::string revocations_stale = {};
};

void add_key_options(CLI::App& command, KeyOptions& options, Trusts trusts);
// Whether any of them was given.
bool is_given(const KeyOptions& options);

struct TrustOption {
  PublicKey key{};
  // Empty: no shared key.
  std::string psk_file;
};
TrustOption parse_trust_option(std::string_view text);
// What is wrong with a public key on the command line; empty: nothing.
std::string mistake_in_key(const std::string& text);

// The keys of a program while it runs. Thread-compatible.
class Credentials {
 public:
  // Reads the files. The program's own key is locked as long as this lives.
  Credentials(const KeyOptions& options, Trusts trusts);

  // Sets NodeOptions::security, or ::insecure.
  void apply(NodeOptions& node) const;
  // Ours; zeros without keys.
  PublicKey public_key() const { return own_ ? public_key_of(own_->key()) : PublicKey{}; }
  // What to tell whoever started the program, one line each.
  std::vector<std::string> warnings() const;
  // Where the program's newest time belongs; nothing without a key.
  const TimeFile* time_file() const { return time_ ? &*time_ : nullptr; }
  // Where lists of revocations that peers hand on belong; nothing where no file was given.
  const RevocationsFile* revocations_file() const { return list_ ? &*list_ : nullptr; }
  // When the list that is there at the start was issued; 0: there is none. And what a later one
  // says, which one of the authorities must have signed.
  std::int64_t list_issued_s() const { return list_ ? list_->issued_s() : 0; }
  SignedList read_list(ByteView list) const;
  // What to tell of a list that was issued then, 0: there is none; empty: it is new enough.
  std::string stale_list(std::int64_t issued_s, std::int64_t unix_s) const;

 private:
  void read_fleet(const KeyOptions& options);

  bool insecure_;
  std::optional<OwnKey> own_;
  std::optional<TimeFile> time_;
  std::vector<TrustedPeer> trusted_;
  std::vector<PublicKey> authorities_;
  std::optional<CredentialFile> credential_;
  std::optional<RevocationsFile> list_;
  std::int64_t max_age_s_ = 0;
  StaleRevocations stale_ = StaleRevocations::kRefuse;
};

}  // namespace interneuron::settings
