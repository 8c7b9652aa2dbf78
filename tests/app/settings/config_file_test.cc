#include "app/settings/config_file.h"
#include "tests/places.h"

#include <algorithm>
#include <fstream>
#include <regex>
#include <set>

#include "app/process/failure.h"
#include "app/settings/command_line.h"
#include "tests/app/cli/support.h"

namespace interneuron::settings::config_file_test {
namespace {

struct Command {
  CLI::App app{"test", "vehicle"};
  std::vector<std::string> links;
  double deadline_ms = 130;
  int rounds = 0;
  bool quiet = false;

  Command() {
    app.add_option("--link", links)->take_all();
    app.add_option("--deadline-ms", deadline_ms)->check(positive_number());
    app.add_option("--rounds", rounds);
    app.add_flag("--quiet", quiet);
    add_config_option(app);
  }
  // What the file is refused with; empty when it is accepted.
  std::string apply(const std::string& text, const std::string& arguments = "") {
    const cli::TempFolder folder;
    const std::string file = folder / "c.toml";
    std::ofstream(file) << text;
    app.parse("--config '" + file + "' " + arguments, false);
    try {
      apply_config(app);
    } catch (const process::Failure& failure) {
      EXPECT_EQ(failure.code(), process::kConfiguration);
      const std::string what = failure.what();
      return what.substr(what.find("c.toml"));
    }
    return "";
  }
};

TEST(ConfigFile, KeysAreTheLongOptions) {
  Command c;
  EXPECT_EQ(c.apply("link = ['a=1', 'b=2']\ndeadline_ms = 99.5\nrounds = 7\nquiet = true\n"), "");
  EXPECT_EQ(c.links, (std::vector<std::string>{"a=1", "b=2"}));
  EXPECT_EQ(c.deadline_ms, 99.5);
  EXPECT_EQ(c.rounds, 7);
  EXPECT_TRUE(c.quiet);
}

TEST(ConfigFile, AMistakeIsOneLineWhateverTheFileHolds) {
  for (const char* text :
       {"quiet = t\n", "\"a\\nb\" = 1\n", "rounds = \"a\\nb\"\n", "\"\\u001b[2J\" = 1\n"}) {
    Command c;
    const std::string what = c.apply(text);
    EXPECT_NE(what, "") << text;
    EXPECT_EQ(what.find_first_of("\n\x1b"), std::string::npos) << what;
  }
}

TEST(ConfigFile, TheCommandLineWins) {
  Command c;
  EXPECT_EQ(c.apply("rounds = 7\n", "--rounds 3"), "");
  EXPECT_EQ(c.rounds, 3);
}

TEST(ConfigFile, AnUnknownKeyIsNamedWithItsPlaceAndTheNearest) {
  Command c;
  const std::string error = c.apply("rounds = 1\ndeadlin_ms = 5\n");
  EXPECT_NE(error.find("c.toml:2:"), std::string::npos) << error;
  EXPECT_NE(error.find("deadlin_ms"), std::string::npos) << error;
  EXPECT_NE(error.find("deadline_ms"), std::string::npos) << error;
}

TEST(ConfigFile, ABadValueIsNamedWithItsPlace) {
  EXPECT_NE(Command().apply("deadline_ms = -1\n").find("c.toml:1:"), std::string::npos);
  EXPECT_EQ(Command().apply("deadline_ms = 'x'\n"),
            "c.toml:1:15: deadline_ms: 'x': give a number above 0");
  EXPECT_EQ(Command().apply("quiet = []\n"),
            "c.toml:1:9: quiet: an empty list; give a value or leave it out");
  EXPECT_NE(Command().apply("rounds = 'many'\n").find("rounds"), std::string::npos);
  EXPECT_NE(Command().apply("rounds = { a = 1 }\n").find("rounds"), std::string::npos);
}

TEST(ConfigFile, MalformedTomlIsNamedWithItsPlace) {
  EXPECT_NE(Command().apply("rounds = \n").find("c.toml:1:"), std::string::npos);
}

// The examples stay true: the programs read them, and fail for the cards that this host has not.
TEST(ConfigFile, TheExamplesAreAccepted) {
  const std::string examples = places::source() + "/examples/";
  const cli::Ran road =
      cli::run("road --insecure --ladder motion --config '" + examples + "road.toml' --nic wwan77");
  EXPECT_EQ(road.code, 2) << road.output;
  EXPECT_NE(road.output.find("wwan77"), std::string::npos) << road.output;
  const cli::TempFolder folder;
  ASSERT_EQ(cli::run("keys gen --out '" + (folder / "key").string() + "'").code, 0);
  const cli::Ran vehicle =
      cli::run("vehicle --key '" + (folder / "key").string() +
               "' --peer-key hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo= --ladder "
               "motion --video '" +
               places::source() + "/docs/latency.png' --config '" + examples +
               "vehicle.toml' --link wwan77=192.0.2.7:1");
  EXPECT_EQ(vehicle.code, 2) << vehicle.output;
  EXPECT_NE(vehicle.output.find("wwan77"), std::string::npos) << vehicle.output;
}

TEST(ConfigFile, AnUnknownCardIsUsageOnTheCommandLineAndConfigurationInTheFile) {
  const cli::TempFolder folder;
  const std::string file = folder / "c.toml";
  std::ofstream(file) << "nic = ['wwan77']\nladder = 'none'\ninsecure = true\n";
  EXPECT_EQ(cli::run("road --config '" + file + "'").code, process::kConfiguration);
  EXPECT_EQ(cli::run("road --config '" + file + "' --nic wwan78").code, process::kUsage);
}

// The long options that a command's help shows, as keys of a configuration file. `--nic,--link` are
// two names of one option, of which the first is the key.
std::set<std::string> keys_of(const std::string& command) {
  const cli::Ran help = cli::run(command + " --help");
  std::set<std::string> keys;
  const std::regex option("\n  (?:-[a-zA-Z],)?--([a-z-]+)");
  for (auto it = std::sregex_iterator(help.output.begin(), help.output.end(), option);
       it != std::sregex_iterator(); ++it) {
    std::string key = (*it)[1];
    std::ranges::replace(key, '-', '_');
    if (key != "help" && key != "config") keys.insert(key);
  }
  return keys;
}

// "key = value" at the beginning of a line, or commented out by "# ". Not the keys of [[link]].
std::set<std::string> keys_in(const std::string& example) {
  std::ifstream in(places::source() + "/examples/" + example);
  std::set<std::string> keys;
  const std::regex key("^(?:# )?([a-z_]+) = .*");
  for (std::string line; std::getline(in, line);) {
    std::smatch found;
    if (std::regex_match(line, found, key)) keys.insert(found[1]);
  }
  return keys;
}

TEST(ConfigFile, TheExamplesNameEveryOption) {
  for (const std::string command : {"vehicle", "road"}) {
    EXPECT_GT(keys_of(command).size(), 10U) << command;
    EXPECT_EQ(keys_in(command + ".toml"), keys_of(command));
  }
}

}  // namespace
}  // namespace interneuron::settings::config_file_test
