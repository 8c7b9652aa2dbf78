#include <gmock/gmock.h>

#include <fstream>
#include <functional>

#include "netns/state/error.h"
#include "support.h"
#include "tests/places.h"

namespace interneuron::netns::scenario_test {
namespace {

using testing::HasSubstr;

emu::ScenarioLink load(const std::string& what) { return scenario_of({what}, 1).links.at(0); }

// A missing or wrong file is an error of configuration (3), an unknown name one of usage (2).
std::string refusal_of(const std::function<void()>& attempt, int exit_code = 3) {
  try {
    attempt();
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, exit_code);
    EXPECT_THAT(error.what(), testing::Not(HasSubstr("\n")));
    return error.what();
  }
  return "none";
}

std::string refusal(const std::string& link, int exit_code = 3) {
  return refusal_of([&] { load(link); }, exit_code);
}

TEST(Scenario, DefaultIs5gThen4g) {
  const auto links = default_scenario().links;
  ASSERT_EQ(links.size(), 2U);
  EXPECT_EQ(links[0].name, "5g");
  EXPECT_EQ(links[1].name, "4g");
  EXPECT_EQ(links[1].profile.delay.max_ms, 994);
  EXPECT_EQ(links[1].seed, emu::link_seed(1, 1));
}

TEST(Scenario, NamesABuiltInProfileOrAFileOrBoth) {
  EXPECT_EQ(load("clean").name, "clean");
  EXPECT_EQ(load("second=5g").name, "second");
  EXPECT_EQ(load("second=5g").profile.name, "5g");
  const std::string file = places::source() + "/tc_profiles/4g.toml";
  EXPECT_EQ(load(file).name, "4g");
  EXPECT_EQ(load("lte=" + file).name, "lte");
}

TEST(Scenario, SaysWhatIsWrong) {
  EXPECT_THAT(refusal("6g", 2), HasSubstr("6g"));
  EXPECT_THAT(refusal("./nowhere.toml"), HasSubstr("./nowhere.toml"));
  const RuntimeDir dir;
  const std::string file = dir.path() / "bad.toml";
  std::ofstream(file) << "schema = 1\nmodell = \"constant\"\n";
  EXPECT_THAT(refusal(file),
              HasSubstr("bad.toml:2:1: unknown key 'modell'; did you mean 'model'?"));
}

TEST(Scenario, FindsProfilesBesideItsFile) {
  const RuntimeDir dir;
  std::filesystem::copy_file(places::source() + "/tc_profiles/clean.toml",
                             dir.path() / "mine.toml");
  const auto file = dir.path() / "scenario.toml";
  std::ofstream(file) << "schema = 1\nseed = 5\n[[link]]\nname = \"a\"\n"
                         "profile = \"./mine.toml\"\n"
                         "[[link]]\nname = \"b\"\nprofile = \"5g\"\nseed = 1154\n";
  const emu::Scenario own = load_scenario(file);
  EXPECT_EQ(own.seed, 5U);
  EXPECT_EQ(own.links[0].profile.name, "clean");
  EXPECT_EQ(own.links[0].seed, emu::link_seed(5, 0));
  const emu::Scenario other = load_scenario(file, 9);
  EXPECT_EQ(other.links[0].seed, emu::link_seed(9, 0));
  EXPECT_EQ(other.links[1].seed, 1154U);  // its own
  EXPECT_THAT(refusal_of([&] { load_scenario(dir.path() / "none.toml"); }), HasSubstr("none.toml"));
}

TEST(Host, NamesAndNumbers) {
  EXPECT_EQ(host_name(kVehicle), "vehicle");
  EXPECT_EQ(host_name({Host::Kind::kVehicle, 2}), "vehicle3");
  EXPECT_EQ(host_name(kRoad), "road");
  EXPECT_EQ(host_name({Host::Kind::kRoad, 1}), "road2");
  EXPECT_EQ(host_name(kCore), "core");
  EXPECT_EQ(parse_host("vehicle"), kVehicle);
  EXPECT_EQ(parse_host("vehicle1"), kVehicle);
  EXPECT_EQ(parse_host("road12"), (Host{Host::Kind::kRoad, 11}));
  EXPECT_EQ(parse_host("core"), kCore);
  for (const char* text : {"", "vehicle0", "vehicle01", "vehicle-1", "vehicle2x", "core2", "air",
                           "vehicle99999999999999999999"}) {
    try {
      parse_host(text);
      ADD_FAILURE() << text;
    } catch (const TestbedError& error) {
      EXPECT_EQ(error.exit_code, 2);
      EXPECT_THAT(error.what(), HasSubstr(std::string("no host '") + text + "'"));
    }
  }
}

}  // namespace
}  // namespace interneuron::netns::scenario_test
