// Who a program is and whom it believes, on the command line and in the configuration file:
//
//   --key FILE                      our private key (key_files.h)
//   --peer-key KEY[,psk=FILE]       of a program that connects: who the roadside unit is
//   --trust KEY[,psk=FILE]          of one that serves: each host that may come
//   --insecure                      no keys, packets in the clear
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

#include "host/settings/key_files.h"
#include "host/settings/time_file.h"
#include "interneuron/node_options.h"

namespace interneuron::cli {

// Whether the program connects to one host or serves any that it trusts.
enum class Trusts { kThePeer, kMany };

struct KeyOptions {
  // A file; empty: default_key_file().
  std::string key = {};
  // Each as --peer-key or --trust gives it.
  std::vector<std::string> trusted = {};
  bool insecure = false;
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

 private:
  bool insecure_;
  std::optional<OwnKey> own_;
  std::optional<TimeFile> time_;
  std::vector<TrustedPeer> trusted_;
};

}  // namespace interneuron::cli
