#include "app/cli/commands.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "app/process/failure.h"
#include "app/settings/key_files.h"
#include "core/secure/credential.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;

// The file that was named, else the default one.
fs::path file_of(const std::string& given, bool authority, const char* remedy) {
  const fs::path by_default =
      authority ? settings::default_authority_file() : settings::default_key_file();
  const fs::path file = given.empty() ? by_default : fs::path(given);
  if (!file.empty()) return file;
  throw process::Failure(process::kConfiguration,
                         std::string("neither XDG_CONFIG_HOME nor HOME names a folder; ") + remedy);
}

// A key of an authority signs, and one of a host does not: their public halves differ.
void print_public_half(const SecretKey& key, bool authority) {
  fmt::print("{}\n", to_base64(authority ? crypto::authority_key_of(key) : public_key_of(key)));
}

int generate(const std::string& out, bool authority) {
  const fs::path file = file_of(out, authority, "give --out FILE");
  const SecretKey key = random_key();
  settings::write_new_key(file, key);
  fmt::print(stderr, "private key {}in {}; its public key, for those who are to trust {}:\n",
             authority ? "of a fleet authority " : "", file.string(),
             authority ? "whom it signs" : "this host");
  print_public_half(key, authority);
  return process::kFine;
}

int tell_public(const std::string& given, bool authority) {
  if (given == "-") {
    print_public_half(settings::read_key_from_stdin(), authority);
  } else {
    const fs::path file = file_of(given, authority, "give FILE, or - for the standard input");
    print_public_half(settings::read_key(file), authority);
  }
  return process::kFine;
}

void add_generate(CLI::App& keys, std::function<int()>& run) {
  auto out = std::make_shared<std::string>();
  auto authority = std::make_shared<bool>(false);
  CLI::App* c = keys.add_subcommand("gen", "Make a private key; prints its public key");
  c->add_flag("--authority", *authority, "One of a fleet authority, which signs those of hosts");
  c->add_option("--out", *out,
                "File to write, which must not be there yet (default: `key`, or `authority`, in "
                "$XDG_CONFIG_HOME/interneuron, else in ~/.config/interneuron)")
      ->type_name("FILE");
  c->callback(
      [&run, out, authority] { run = [out, authority] { return generate(*out, *authority); }; });
}

void add_public(CLI::App& keys, std::function<int()>& run) {
  auto file = std::make_shared<std::string>();
  auto authority = std::make_shared<bool>(false);
  CLI::App* c = keys.add_subcommand("pub", "Print the public key of a private one");
  c->add_flag("--authority", *authority, "The private one is that of a fleet authority");
  c->add_option("FILE", *file,
                "File with the private key; -: the standard input (default: that of `keys gen`)");
  c->callback([&run, file, authority] {
    run = [file, authority] { return tell_public(*file, *authority); };
  });
}

void add_shared(CLI::App& keys, std::function<int()>& run) {
  CLI::App* c =
      keys.add_subcommand("psk", "Print a new key for two hosts to share, as a second lock");
  c->callback([&run] {
    run = [] {
      fmt::print("{}\n", to_base64(random_key().bytes()));
      return process::kFine;
    };
  });
}

}  // namespace

void add_keys(CLI::App& program, std::function<int()>& run) {
  CLI::App* c = program.add_subcommand("keys", "Make the keys by which hosts know each other");
  c->require_subcommand(1);
  add_generate(*c, run);
  add_public(*c, run);
  add_shared(*c, run);
  add_fleet_keys(*c, run);
  c->footer(
      "Examples:\n  interneuron keys gen                                # once on every host\n"
      "  interneuron road --nic eth0 --trust VEHICLE_KEY     # what `keys gen` printed there\n"
      "  interneuron vehicle --link wwan0=192.0.2.7:47000 --peer-key ROAD_KEY\n"
      "  (umask 077; interneuron keys psk > vehicle7.psk)    # then --trust "
      "VEHICLE_KEY,psk=vehicle7.psk\n"
      "Of a fleet:\n  interneuron keys gen --authority                    # once, where keys are "
      "kept safe\n"
      "  interneuron keys sign --authority ~/.config/interneuron/authority --id bus7 VEHICLE_KEY > "
      "bus7.credential\n"
      "  interneuron keys revoke --authority ~/.config/interneuron/authority --list revoked "
      "LOST_KEY\n"
      "  interneuron road --nic eth0 --authority AUTHORITY_KEY --revocations revoked\n"
      "  interneuron vehicle --link wwan0=192.0.2.7:47000 --peer-key ROAD_KEY --credential "
      "bus7.credential");
}

}  // namespace interneuron::cli
