// `interneuron probe` and `road --stamp` as users call them, over the loopback; and STAMP against
// an implementation of its own.
#include <nlohmann/json.hpp>
#include <sstream>

#include "beside.h"
#include "support.h"

namespace interneuron::cli::probe_test {
namespace {

using Json = nlohmann::json;

std::string road(const std::string& options) {
  return "'" + places::program() +
         "' road --insecure --nic lo --port 0 --ladder motion --calibration-runs 1 --video "
         "'" +
         places::source() + "/docs/latency.png' " + options;
}

const std::string kScript =
    "/usr/bin/python3 '" + places::source() + "/tests/app/cli/stamp_rfc8762.py' ";

std::string a_port() { return std::to_string(20'000 + ::getpid() % 20'000); }

std::size_t fates(const Json& nic) {
  std::size_t sum = 0;
  for (const char* key : {"answered_packets", "late_packets", "lost_up_packets",
                          "lost_down_packets", "lost_packets"}) {
    sum += nic[key].get<std::size_t>();
  }
  return sum;
}

TEST(Probe, ARoadsideUnitAnswersOnItsNormalPort) {
  const Beside unit(road(""));
  ASSERT_TRUE(unit.ready());
  const std::string peer = "127.0.0.1:" + unit.port();
  const Ran ran =
      run("probe --insecure --peer " + peer + " --count 20 --interval 2ms --json", false);
  ASSERT_EQ(ran.code, 0) << ran.output;
  const Json json = Json::parse(ran.output);
  EXPECT_EQ(json["schema"], "interneuron.probe/1");
  EXPECT_EQ(json["format"], "echo");
  ASSERT_EQ(json["nics"].size(), 1U);
  const Json& nic = json["nics"][0];
  EXPECT_EQ(nic["nic"], "lo");
  EXPECT_EQ(nic["peer"], peer);
  EXPECT_EQ(nic["sent_packets"], 20);
  EXPECT_EQ(nic["answered_packets"], 20);
  EXPECT_EQ(fates(nic), 20U);
  EXPECT_GT(nic["rtt"]["p50_ms"].get<double>(), 0);
  EXPECT_LT(nic["rtt"]["p50_ms"].get<double>(), 50);
  EXPECT_GT(nic["train_answered_packets"].get<int>(), 0);

  const Ran stream =
      run("probe --insecure --peer " + peer + " --count 20 --interval 2ms --no-rate --json-stream",
          false);
  EXPECT_EQ(stream.code, 0);
  std::istringstream lines(stream.output);
  std::vector<Json> objects;
  for (std::string line; std::getline(lines, line);) objects.push_back(Json::parse(line));
  ASSERT_EQ(objects.size(), 21U);
  EXPECT_EQ(objects[0]["schema"], "interneuron.probe.reply/1");
  EXPECT_EQ(objects[0]["nic"], "lo");
  EXPECT_EQ(objects.back()["schema"], "interneuron.probe/1");

  EXPECT_THAT(run("probe --insecure --peer " + peer + " --count 5 --interval 2ms --no-rate", false),
              EndsSaying(0, "rtt min/p50/p95/max ms"));
}

TEST(Probe, NobodyAnswers) {
  const Ran ran = run("probe --insecure --peer 127.0.0.1:" + a_port() +
                      " --count 3 --interval 2ms --timeout 100ms --json");
  EXPECT_EQ(ran.code, 1);
  EXPECT_NE(ran.output.find("lo: no reply from 127.0.0.1:" + a_port()), std::string::npos)
      << ran.output;
  EXPECT_NE(ran.output.find("interneuron road"), std::string::npos) << "the remedy";
}

TEST(Probe, CtrlCEndsItWithTheSummary) {
  const Beside reflector(kScript + "reflect 0 stateful 0");
  ASSERT_TRUE(reflector.ready());
  const Ran ran = [&] {
    const std::string command =
        "timeout -s INT 1 '" + places::program() +
        "' probe --count 0 --interval 5ms --no-rate --json --stamp=" + reflector.port() +
        " --peer 127.0.0.1 2>/dev/null; echo \"code $?\"";
    Ran out;
    FILE* pipe = ::popen(command.c_str(), "r");
    std::array<char, 4096> chunk;
    while (const std::size_t n = std::fread(chunk.data(), 1, chunk.size(), pipe)) {
      out.output.append(chunk.data(), n);
    }
    ::pclose(pipe);
    return out;
  }();
  // 124: timeout had to send the signal.
  const auto end = ran.output.rfind("code 124");
  ASSERT_NE(end, std::string::npos) << ran.output;
  const Json json = Json::parse(ran.output.substr(0, end));
  EXPECT_GT(json["nics"][0]["answered_packets"].get<int>(), 0);
  EXPECT_EQ(fates(json["nics"][0]), json["nics"][0]["sent_packets"].get<std::size_t>());
}

TEST(Stamp, TheRoadsideUnitAnswersAsTheRfcSays) {
  for (const std::string kind : {"stateful", "stateless"}) {
    const std::string port = a_port();
    const Beside unit(road("--stamp " + port + (kind == "stateless" ? " --stamp-stateless" : "")));
    ASSERT_TRUE(unit.ready());
    const std::string command = kScript + "send 127.0.0.1 " + port + " 30 " + kind;
    EXPECT_EQ(std::system(command.c_str()), 0) << kind;
  }
}

TEST(Stamp, AReflectorThatIsNotOursIsMeasured) {
  for (const std::string kind : {"stateful", "stateless"}) {
    const Beside reflector(kScript + "reflect 0 " + kind + " 5");
    ASSERT_TRUE(reflector.ready());
    const Ran ran = run("probe --peer 127.0.0.1 --stamp=" + reflector.port() +
                            " --count 100 --interval 2ms --timeout 300ms --size 200 --no-rate "
                            "--json",
                        false);
    ASSERT_EQ(ran.code, 0) << ran.output;
    const Json nic = Json::parse(ran.output)["nics"][0];
    EXPECT_EQ(fates(nic), 100U);
    EXPECT_EQ(nic["reflector_counts"], kind == "stateful");
    EXPECT_EQ(nic["lost_up_packets"], 0);
    EXPECT_EQ(nic["lost_down_packets"], kind == "stateful" ? 20 : 0);
    EXPECT_EQ(nic["lost_packets"], kind == "stateful" ? 0 : 20);
  }
}

}  // namespace
}  // namespace interneuron::cli::probe_test
