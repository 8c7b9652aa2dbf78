#include "app/cli/keys_command.h"

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "host/process/failure.h"
#include "host/settings/key_files.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;

// The file that was named, else the default one.
fs::path file_of(const std::string& given, const char* remedy) {
  const fs::path file = given.empty() ? default_key_file() : fs::path(given);
  if (!file.empty()) return file;
  throw Failure(kConfiguration,
                std::string("neither XDG_CONFIG_HOME nor HOME names a folder; ") + remedy);
}

void print(const PublicKey& key) { fmt::print("{}\n", to_base64(key)); }

int generate(const std::string& out) {
  const fs::path file = file_of(out, "give --out FILE");
  const SecretKey key = random_key();
  write_new_key(file, key);
  fmt::print(stderr, "private key in {}; its public key, for those who are to trust this host:\n",
             file.string());
  print(public_key_of(key));
  return kFine;
}

int tell_public(const std::string& given) {
  if (given == "-") {
    print(public_key_of(read_key_from_stdin()));
  } else {
    print(public_key_of(read_key(file_of(given, "give FILE, or - for the standard input"))));
  }
  return kFine;
}

void add_generate(CLI::App& keys, std::function<int()>& run) {
  auto out = std::make_shared<std::string>();
  CLI::App* c = keys.add_subcommand("gen", "Make a private key; prints its public key");
  c->add_option("--out", *out,
                "File to write, which must not be there yet (default: "
                "$XDG_CONFIG_HOME/interneuron/key, else ~/.config/interneuron/key)")
      ->type_name("FILE");
  c->callback([&run, out] { run = [out] { return generate(*out); }; });
}

void add_public(CLI::App& keys, std::function<int()>& run) {
  auto file = std::make_shared<std::string>();
  CLI::App* c = keys.add_subcommand("pub", "Print the public key of a private one");
  c->add_option("FILE", *file,
                "File with the private key; -: the standard input (default: that of `keys gen`)");
  c->callback([&run, file] { run = [file] { return tell_public(*file); }; });
}

void add_shared(CLI::App& keys, std::function<int()>& run) {
  CLI::App* c =
      keys.add_subcommand("psk", "Print a new key for two hosts to share, as a second lock");
  c->callback([&run] {
    run = [] {
      fmt::print("{}\n", to_base64(random_key().bytes()));
      return kFine;
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
  c->footer(
      "Examples:\n  interneuron keys gen                                # once on every host\n"
      "  interneuron road --nic eth0 --trust VEHICLE_KEY     # what `keys gen` printed there\n"
      "  interneuron vehicle --link wwan0=192.0.2.7:47000 --peer-key ROAD_KEY\n"
      "  (umask 077; interneuron keys psk > vehicle7.psk)    # then --trust "
      "VEHICLE_KEY,psk=vehicle7.psk");
}

}  // namespace interneuron::cli
