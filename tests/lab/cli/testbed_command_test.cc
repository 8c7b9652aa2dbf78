#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/app/cli/beside.h"
#include "tests/app/cli/support.h"

namespace interneuron::cli::testbed_command_test {
namespace {

class TestbedCommand : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = no_testbed();
    if (!why.empty()) GTEST_SKIP() << why;
  }
  void TearDown() override { run("testbed down" + name_); }

  nlohmann::json status() {
    const Ran ran = run("testbed status --json" + name_);
    EXPECT_EQ(ran.code, 0) << ran.output;
    return nlohmann::json::parse(ran.output, nullptr, false);
  }

  const std::string name_ = " --name test-" + std::to_string(::getpid());
};

TEST_F(TestbedCommand, UpRunStatusDown) {
  const Ran ran = run("testbed up --profile clean" + name_);
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_THAT(run("testbed up --profile clean" + name_), EndsSaying(1, "already up"));
  EXPECT_THAT(run("testbed run --in vehicle" + name_ + " -- ping -c 2 -i 0.2 10.77.0.1"),
              EndsSaying(0, "2 received"));
  EXPECT_EQ(run("testbed run --in road" + name_ + " -- sh -c 'exit 42'").code, 42);
  const auto json = status();
  EXPECT_EQ(json["schema"], "interneuron.testbed/2");
  EXPECT_EQ(json["links"][0]["road_address"], "10.77.0.1");
  EXPECT_EQ(json["links"][0]["up"]["delivered"], 2);
  EXPECT_EQ(run("testbed down" + name_).code, 0);
  EXPECT_EQ(run("testbed status" + name_).code, 1);
}

TEST_F(TestbedCommand, ChangesAndEventsOfALink) {
  ASSERT_EQ(run("testbed up --profile a=clean,b=clean --backend emulator" + name_).code, 0);
  ASSERT_EQ(run("testbed run" + name_ + " -- ping -c 1 10.77.0.1").code, 0);
  EXPECT_EQ(run("testbed set a rtt_ms=150 up.rate_mbit=7" + name_).code, 0);
  auto json = status();
  EXPECT_NEAR(json["links"][0]["now"]["rtt_ms"], 150, 0.1);
  EXPECT_NEAR(json["links"][0]["now"]["rate_up_mbit"], 7, 0.01);
  EXPECT_LT(json["links"][1]["now"]["rtt_ms"], 100);
  EXPECT_EQ(run("testbed set a profile=4g" + name_).code, 0);
  EXPECT_EQ(run("testbed event b outage 10s" + name_).code, 0);
  EXPECT_NE(run("testbed run" + name_ + " -- ping -c 1 -W 0.3 -I ifb 10.78.0.1").code, 0);
  json = status();
  EXPECT_EQ(json["links"][0]["now"]["outage"], false);
  EXPECT_EQ(json["links"][1]["now"]["outage"], true);
  EXPECT_TRUE(json["links"][1]["now"]["rtt_ms"].is_null());
  const Ran table = run("testbed status" + name_);
  EXPECT_TRUE(std::regex_search(table.output, std::regex("\nb up +outage "))) << table.output;
  EXPECT_FALSE(std::regex_search(table.output, std::regex("\na up +outage "))) << table.output;
}

TEST_F(TestbedCommand, MistakesInChangesAreOneLine) {
  ASSERT_EQ(run("testbed up --profile clean" + name_).code, 0);
  EXPECT_THAT(run("testbed set clean rt_ms=5" + name_), EndsSaying(2, "rtt_ms"));
  EXPECT_THAT(run("testbed set wifi rtt_ms=5" + name_), EndsSaying(2, "clean"));
  EXPECT_THAT(run("testbed set clean loss=7" + name_), EndsSaying(2, "loss"));
  EXPECT_THAT(run("testbed set clean profile=6g" + name_), EndsSaying(2, "6g"));
  EXPECT_THAT(run("testbed set clean profile=./6g.toml" + name_), EndsSaying(3, "6g.toml"));
  EXPECT_EQ(run("testbed event clean earthquake 5s" + name_).code, 2);
  EXPECT_THAT(run("testbed run --in vehicle9" + name_ + " -- true"), EndsSaying(2, "vehicle9"));
}

TEST_F(TestbedCommand, AScenarioFixesLinksSeedsAndEvents) {
  const TempFolder folder;
  std::ofstream(folder / "s.toml") << "schema = 1\nseed = 3\n"
                                      "[[link]]\nname = \"a\"\nprofile = \"4g\"\nseed = 1287\n"
                                      "[[event]]\nat_s = 0.2\nlink = \"a\"\nrtt_ms = 77\n";
  const std::string file = (folder / "s.toml").string();
  const Ran planned = run("testbed schedule --seconds 0.4 --scenario " + file);
  ASSERT_EQ(planned.code, 0) << planned.output;
  EXPECT_NE(planned.output.find("\n0.30,a,77.000,"), std::string::npos) << planned.output;
  ASSERT_EQ(run("testbed up --scenario " + file + name_).code, 0);
  ASSERT_EQ(run("testbed run" + name_ + " -- ping -c 3 -i 0.2 10.77.0.1").code, 0);
  const auto json = status();
  EXPECT_EQ(json["seed"], 3);
  EXPECT_NEAR(json["links"][0]["now"]["rtt_ms"], 77, 0.1);
}

// A roadside unit has an address on each network. One that is asked on the address of another
// network answers from that address, as the routes of a host with several cards require.
TEST_F(TestbedCommand, OneAddressOfARoadsideUnitIsMeasuredOverEveryCard) {
  ASSERT_EQ(run("testbed up --profile a=clean,b=clean" + name_).code, 0);
  const Beside road("env XDG_RUNTIME_DIR='" + places::build() + "/run' '" + places::program() +
                    "' testbed run --in road" + name_ + " -- '" + places::program() +
                    "' road --insecure --nic ifa --nic ifb --ladder none --stamp 8620");
  ASSERT_TRUE(road.ready());
  for (const std::string format : {" --insecure", " --stamp 8620"}) {
    const Ran ran =
        run("testbed run" + name_ + " -- '" + places::program() +
                "' probe --peer 10.77.0.1 --count 20 --interval 5ms --no-rate --json" + format,
            false);
    EXPECT_EQ(ran.code, 0) << ran.output;
    const auto json = nlohmann::json::parse(ran.output, nullptr, false);
    ASSERT_EQ(json["nics"].size(), 2U) << ran.output;
    for (const auto& nic : json["nics"]) EXPECT_GT(nic["answered_packets"], 15) << ran.output;
  }
}

TEST(Schedule, IsDrawnInTheFormatOfTheSuffix) {
  const TempFolder folder;
  for (const auto& [file, begin] :
       {std::pair{"x.svg", std::string("<?xml")}, std::pair{"x.png", std::string("\x89PNG")}}) {
    const Ran ran = run("testbed schedule --seconds 1 --plot '" + (folder / file).string() + "'");
    if (ran.output.find("install the package gnuplot") != std::string::npos) GTEST_SKIP();
    ASSERT_EQ(ran.code, 0) << ran.output;
    std::ifstream in(folder / file);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    EXPECT_EQ(text.substr(0, begin.size()), begin) << file;
  }
}

TEST_F(TestbedCommand, ListNamesProfilesAndTestbeds) {
  ASSERT_EQ(run("testbed up --profile clean" + name_).code, 0);
  const Ran ran = run("testbed list");
  EXPECT_EQ(ran.code, 0);
  EXPECT_NE(ran.output.find("5g "), std::string::npos) << ran.output;
  EXPECT_NE(ran.output.find(name_.substr(8)), std::string::npos) << ran.output;
}

// Whether the figures are within their bounds depends on what else this machine does; that they
// are all there does not.
TEST_F(TestbedCommand, VerifyMeasuresEveryFigure) {
  EXPECT_EQ(run("testbed verify" + name_).code, 1);  // not up
  ASSERT_EQ(run("testbed up --profile clean" + name_).code, 0);
  const Ran ran = run("testbed verify --seconds 20 --json" + name_, false);
  if (ran.output.empty() && ran.code == 77) GTEST_SKIP() << "ping, iperf3 or tcpdump is missing";
  const auto json = nlohmann::json::parse(ran.output, nullptr, false);
  ASSERT_TRUE(json.is_object()) << ran.code << ran.output;
  EXPECT_EQ(json["schema"], "interneuron.verify/1");
  ASSERT_EQ(json["links"].size(), 1U);
  EXPECT_EQ(json["links"][0]["figures"].size(), 16U) << ran.output;
  EXPECT_GT(json["links"][0]["pings"], 200) << ran.output;
  for (const char* direction : {"up", "down"}) {
    EXPECT_GT(json["links"][0]["packets"][direction]["sent"], 2000) << ran.output;
  }
  for (const auto& figure : json["links"][0]["figures"]) {
    EXPECT_FALSE(figure["measured"].is_null()) << figure.dump();
    // Whatever the machine does, a link without loss loses nothing and keeps the order.
    if (figure["unit"] == "packets") {
      EXPECT_EQ(figure["verdict"], "ok") << figure.dump();
    }
  }
}

}  // namespace
}  // namespace interneuron::cli::testbed_command_test
