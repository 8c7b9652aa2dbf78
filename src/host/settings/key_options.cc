#include "host/settings/key_options.h"

#include <algorithm>
#include <filesystem>

#include "host/io/steady_clock.h"
#include "host/process/failure.h"
#include "host/toml/toml_reader.h"

namespace interneuron::cli {
namespace {

constexpr std::string_view kPsk = "psk=";

const char* name_of(Trusts trusts) { return trusts == Trusts::kMany ? "--trust" : "--peer-key"; }

[[noreturn]] void lacks(const std::string& what) { throw Failure(kConfiguration, what); }

// What is wrong with the option; empty: nothing.
std::string mistake_in_trust(const std::string& text) {
  try {
    parse_trust_option(text);
    return "";
  } catch (const Failure& failure) {
    return failure.what();
  }
}

void refuse_contradiction(const KeyOptions& options, Trusts trusts) {
  const bool keys = !options.key.empty() || !options.trusted.empty();
  if (!options.insecure || !keys) return;
  const std::string given = !options.key.empty() ? "--key" : name_of(trusts);
  throw Failure(kUsage, "--insecure sends everything in the clear and uses no key; leave out " +
                            given + ", or --insecure");
}

OwnKey own_key(const std::filesystem::path& file, bool is_default) {
  const std::string remedy = ", or pass --insecure in a closed network";
  if (file.empty())
    lacks("no key: give --key FILE of one that `interneuron keys gen` made" + remedy);
  std::error_code ignored;
  if (is_default && !std::filesystem::exists(file, ignored)) {
    lacks("no key: run `interneuron keys gen`" + remedy);
  }
  return OwnKey(file);
}

std::vector<TrustedPeer> read_trusted(const KeyOptions& options, Trusts trusts,
                                      const PublicKey& own) {
  std::vector<TrustedPeer> out;
  for (const std::string& text : options.trusted) {
    const TrustOption option = parse_trust_option(text);
    if (option.key == own) {
      lacks(std::string(name_of(trusts)) + " " + to_base64(own) +
            " is this host's own key; give that of the other host");
    }
    TrustedPeer peer{option.key, {}};
    if (!option.psk_file.empty()) peer.shared = read_key(option.psk_file);
    out.push_back(peer);
  }
  return out;
}

}  // namespace

TrustOption parse_trust_option(std::string_view text) {
  const std::size_t comma = text.find(',');
  const auto key = parse_key(text.substr(0, comma));
  const std::string_view rest = comma == text.npos ? "" : text.substr(comma + 1);
  const bool good_rest =
      comma == text.npos || (rest.starts_with(kPsk) && rest.size() > kPsk.size());
  if (!key || !good_rest) {
    throw Failure(kUsage, one_line("'" + std::string(text) +
                                   "': give a public key of 44 characters, as `interneuron keys "
                                   "pub` prints it, and behind it ,psk=FILE if need be"));
  }
  return {*key, rest.empty() ? "" : std::string(rest.substr(kPsk.size()))};
}

void add_key_options(CLI::App& command, KeyOptions& options, Trusts trusts) {
  command
      .add_option("--key", options.key,
                  "File with this host's private key, which `interneuron keys gen` makes (default: "
                  "~/.config/interneuron/key)")
      ->type_name("FILE");
  CLI::Option* trusted =
      trusts == Trusts::kMany
          ? command
                .add_option("--trust", options.trusted,
                            "Public key of a host that may come; once per host. Behind it "
                            ",psk=FILE of a key that both share")
                ->take_all()
          : command
                .add_option("--peer-key", options.trusted,
                            "Public key of the roadside unit. Behind it ,psk=FILE of a key that "
                            "both share")
                ->expected(1)
                ->take_last();
  trusted->type_name("KEY[,psk=FILE]")->check(mistake_in_trust);
  command.add_flag("--insecure", options.insecure,
                   "No keys: everything is sent in the clear, to and from private addresses alone");
}

bool is_given(const KeyOptions& options) {
  return options.insecure || !options.key.empty() || !options.trusted.empty();
}

Credentials::Credentials(const KeyOptions& options, Trusts trusts) : insecure_(options.insecure) {
  refuse_contradiction(options, trusts);
  if (insecure_) return;
  const std::filesystem::path file =
      options.key.empty() ? default_key_file() : std::filesystem::path(options.key);
  own_.emplace(own_key(file, options.key.empty()));
  if (options.trusted.empty()) {
    lacks(trusts == Trusts::kMany
              ? "nobody is trusted: give --trust KEY of each host that may come, as `interneuron "
                "keys pub` prints it there"
              : "the roadside unit's key is missing: give --peer-key KEY, as `interneuron keys "
                "pub` prints it there");
  }
  trusted_ = read_trusted(options, trusts, public_key_of(own_->key()));
  time_.emplace(file);
}

void Credentials::apply(NodeOptions& node) const {
  node.insecure = insecure_;
  if (insecure_) return;
  auto security = std::make_shared<Security>();
  security->key = own_->key();
  security->peers = trusted_;
  // After the last one that was told to anybody.
  security->unix_time_ns = std::max(io::unix_time_ns(), time_->stored().value_or(0) + 1);
  node.security = security;
}

std::vector<std::string> Credentials::warnings() const {
  if (insecure_) {
    return {
        "--insecure: everything is sent in the clear, and anybody on the way can read and forge "
        "it; for experiments in networks of your own"};
  }
  if (time_->problem().empty()) return {};
  return {time_->problem()};
}

}  // namespace interneuron::cli
