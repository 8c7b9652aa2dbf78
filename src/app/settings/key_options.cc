#include "app/settings/key_options.h"

#include <algorithm>
#include <filesystem>

#include "app/process/failure.h"
#include "app/toml/toml_reader.h"
#include "node/io/steady_clock.h"

namespace interneuron::settings {
namespace {

using process::Failure;
using process::kUsage;

constexpr std::string_view kPsk = "psk=";
constexpr std::size_t kMaxAuthorities = 2;
constexpr std::int64_t kDayS = 24 * 60 * 60;
constexpr int kMaxDays = 3650;

const char* name_of(Trusts trusts) { return trusts == Trusts::kMany ? "--trust" : "--peer-key"; }

[[noreturn]] void lacks(const std::string& what) { throw Failure(process::kConfiguration, what); }

// What is wrong with the option; empty: nothing.
std::string mistake_in_trust(const std::string& text) {
  try {
    parse_trust_option(text);
    return "";
  } catch (const Failure& failure) {
    return failure.what();
  }
}

// The first option that was given and is about keys; nullptr: none.
const char* first_of_keys(const KeyOptions& options, Trusts trusts) {
  if (!options.key.empty()) return "--key";
  if (!options.trusted.empty()) return name_of(trusts);
  if (!options.authorities.empty()) return "--authority";
  if (!options.credential.empty()) return "--credential";
  if (!options.revocations.empty()) return "--revocations";
  if (options.revocations_max_age_days > 0) return "--revocations-max-age";
  return options.revocations_stale.empty() ? nullptr : "--revocations-stale";
}

void refuse_contradiction(const KeyOptions& options, Trusts trusts) {
  const char* given = first_of_keys(options, trusts);
  if (options.insecure && given != nullptr) {
    throw Failure(kUsage, std::string("--insecure sends everything in the clear and uses no key; "
                                      "leave out ") +
                              given + ", or --insecure");
  }
  if (options.authorities.size() > kMaxAuthorities) {
    throw Failure(kUsage,
                  "--authority: at most two, of which one takes the place of the other; leave out "
                  "those that sign no more");
  }
  const char* of_lists = !options.revocations.empty()           ? "--revocations"
                         : options.revocations_max_age_days > 0 ? "--revocations-max-age"
                                                                : nullptr;
  if (of_lists != nullptr && options.authorities.empty()) {
    throw Failure(kUsage, std::string(of_lists) +
                              " is of lists that an authority has signed; add --authority KEY");
  }
  if (!options.revocations_stale.empty() && options.revocations_max_age_days == 0) {
    throw Failure(kUsage,
                  "--revocations-stale says what happens when the list is older than "
                  "--revocations-max-age DAYS; add that");
  }
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

void add_fleet_options(CLI::App& command, KeyOptions& options, Trusts trusts) {
  const bool serves = trusts == Trusts::kMany;
  command
      .add_option("--authority", options.authorities,
                  serves ? "Public key of a fleet authority: vehicles that it has signed may come "
                           "too, without --trust; two while one takes the place of the other"
                         : "Public key of a fleet authority, whose lists of revocations count; two "
                           "while one takes the place of the other")
      ->type_name("KEY")
      ->check(mistake_in_key)
      ->expected(1)
      ->take_all();
  if (!serves) {
    command
        .add_option("--credential", options.credential,
                    "File with what the fleet authority has signed for this host's key "
                    "(`interneuron keys sign`)")
        ->type_name("FILE");
  }
  command
      .add_option("--revocations", options.revocations,
                  "File with the authority's newest list of keys that count no more; newer lists "
                  "that peers hand on are kept there (default: none is kept)")
      ->type_name("FILE");
  if (!serves) return;
  command
      .add_option("--revocations-max-age", options.revocations_max_age_days,
                  "How old that list may be, days (default: any age, and none is wanted)")
      ->type_name("DAYS")
      ->check(CLI::Range(1, kMaxDays));
  command
      .add_option("--revocations-stale", options.revocations_stale,
                  "When it is older, or there is none: refuse vehicles that the authority has "
                  "signed, or accept them; those of --trust always may come (default: refuse)")
      ->type_name("refuse|accept")
      ->check(CLI::IsMember({"refuse", "accept"}));
}

}  // namespace

std::string mistake_in_key(const std::string& text) {
  if (parse_key(text)) return "";
  return toml_reader::one_line("'" + text +
                               "': give a public key of 44 characters, as `interneuron keys pub` "
                               "prints it");
}

TrustOption parse_trust_option(std::string_view text) {
  const std::size_t comma = text.find(',');
  const auto key = parse_key(text.substr(0, comma));
  const std::string_view rest = comma == text.npos ? "" : text.substr(comma + 1);
  const bool good_rest =
      comma == text.npos || (rest.starts_with(kPsk) && rest.size() > kPsk.size());
  if (!key || !good_rest) {
    throw Failure(
        kUsage, toml_reader::one_line("'" + std::string(text) +
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
  add_fleet_options(command, options, trusts);
}

bool is_given(const KeyOptions& options) {
  return options.insecure || first_of_keys(options, Trusts::kMany) != nullptr;
}

Credentials::Credentials(const KeyOptions& options, Trusts trusts) : insecure_(options.insecure) {
  refuse_contradiction(options, trusts);
  if (insecure_) return;
  const std::filesystem::path file =
      options.key.empty() ? default_key_file() : std::filesystem::path(options.key);
  own_.emplace(own_key(file, options.key.empty()));
  const bool serves = trusts == Trusts::kMany;
  if (options.trusted.empty() && !(serves && !options.authorities.empty())) {
    lacks(serves
              ? "nobody is trusted: give --trust KEY of each host that may come, as `interneuron "
                "keys pub` prints it there, or --authority KEY of the fleet"
              : "the roadside unit's key is missing: give --peer-key KEY, as `interneuron keys "
                "pub` prints it there");
  }
  trusted_ = read_trusted(options, trusts, public_key_of(own_->key()));
  time_.emplace(file);
  read_fleet(options);
}

void Credentials::read_fleet(const KeyOptions& options) {
  for (const std::string& text : options.authorities) authorities_.push_back(*parse_key(text));
  if (!options.credential.empty()) {
    credential_.emplace(options.credential, public_key_of(own_->key()), authorities_);
  }
  if (!options.revocations.empty()) list_.emplace(options.revocations, authorities_);
  max_age_s_ = options.revocations_max_age_days * kDayS;
  if (options.revocations_stale == "accept") stale_ = StaleRevocations::kAccept;
}

void Credentials::apply(NodeOptions& node) const {
  node.insecure = insecure_;
  if (insecure_) return;
  auto security = std::make_shared<Security>();
  security->key = own_->key();
  security->peers = trusted_;
  security->authorities = authorities_;
  if (credential_) security->credential = credential_->bytes();
  if (list_) security->revocations = list_->list();
  security->max_revocations_age_s = max_age_s_;
  security->stale_revocations = stale_;
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
  std::vector<std::string> out;
  const auto add = [&out](std::string problem) {
    if (!problem.empty()) out.push_back(std::move(problem));
  };
  add(time_->problem());
  if (credential_) add(credential_->problem(io::unix_time_ns() / 1'000'000'000));
  return out;
}

SignedList Credentials::read_list(ByteView list) const {
  return signed_list(list, authorities_).value_or(SignedList{});
}

std::string Credentials::stale_list(std::int64_t issued_s, std::int64_t unix_s) const {
  if (max_age_s_ == 0 || unix_s - issued_s <= max_age_s_) return "";
  const std::string which = issued_s == 0 ? "there is no list of revocations"
                                          : "the list of revocations is of " + date_text(issued_s) +
                                                ", older than " +
                                                std::to_string(max_age_s_ / kDayS) + " days";
  return which +
         (stale_ == StaleRevocations::kRefuse
              ? ": vehicles that the authority has signed are refused"
              : ": vehicles that the authority has signed may come, revoked or not") +
         "; bring a new one with `interneuron keys revoke` and --revocations FILE";
}

}  // namespace interneuron::settings
