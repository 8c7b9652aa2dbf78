// Every mistake ends with one line that names the thing and the remedy, and the documented exit
// code.
#include <algorithm>
#include <fstream>

#include "support.h"

namespace interneuron::cli::bad_input_test {
namespace {

struct Mistake {
  const char* name;
  const char* arguments;
  int code;
  const char* says;
  std::string program = places::program();
};

void PrintTo(const Mistake& mistake, std::ostream* out) { *out << mistake.arguments; }

class BadInput : public testing::TestWithParam<Mistake> {};

TEST_P(BadInput, IsOneLineWithItsExitCode) {
  const Ran ran = run_program(GetParam().program, GetParam().arguments);
  EXPECT_EQ(ran.code, GetParam().code) << ran.output;
  EXPECT_NE(ran.output.find(GetParam().says), std::string::npos) << ran.output;
  // Nothing but the program's one line. Benches have CLI11's own two lines for mistakes of usage.
  if (GetParam().program == places::program()) {
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Program, BadInput,
    testing::Values(
        Mistake{"NoCommand", "", 2, "subcommand"},
        Mistake{"UnknownCommand", "fly", 2, "unknown command 'fly'"},
        Mistake{"MisspeltCommand", "dmo", 2, "did you mean 'demo'?"},
        Mistake{"MisspeltCommandBehindAnOption", "--pcap x.pcap dmo", 2, "did you mean 'demo'?"},
        Mistake{"MisspeltSubcommand", "testbed stauts", 2, "did you mean 'status'?"},
        Mistake{"UnknownFlag", "demo --sed 2", 2, "--sed"},
        Mistake{"MisspeltOption", "demo --round 5", 2, "did you mean '--rounds'?"},
        Mistake{"MisspeltOptionWithValue", "vehicle --deadlin-ms=5", 2, "'--deadline-ms'"},
        Mistake{"MisspeltOptionOfASubcommand", "testbed up --vehicle 2", 2, "'--vehicles'"},
        Mistake{"MisspeltOptionBeforeTheExperiment", "eval --seed 1..2", 2, "'--seeds'"},
        Mistake{"OptionUnlikeAny", "links --zzzz", 2, "interneuron links --help"},
        Mistake{"OneArgumentTooMany", "demo now", 2, "`interneuron demo` takes no 'now'"},
        Mistake{"DeadlineZero", "demo --deadline-ms 0", 2, "--deadline-ms"},
        Mistake{"DeadlineNegative", "vehicle --link lo=127.0.0.1:1 --deadline-ms -5", 2,
                "--deadline-ms"},
        Mistake{"DeadlineNoNumber", "demo --deadline-ms x", 2, "'x': give a number above 0"},
        Mistake{"RoundsZero", "demo --rounds 0", 2, "--rounds"},
        Mistake{"UnknownPolicy", "demo --policy best", 2, "placement"},
        Mistake{"UnknownImages", "demo --images png", 2, "jpeg"},
        Mistake{"UnknownGuard", "vehicle --guard none", 2, "budget"},
        Mistake{"UnknownProfile", "demo --link 6g", 2, "6g"},
        Mistake{"UnknownGroup", "bench load fast", 2, "rate"},
        Mistake{"UnknownTransport", "bench load --peer quic", 2, "quic"},
        Mistake{"LoadOfAGroupWithoutLoads", "bench load dip --load 2", 2, "dip"},
        Mistake{"LoadZero", "bench load --load 0", 2, "--load"},
        Mistake{"PictureOfAnotherKind", "bench load --plot load.pdf", 2, ".svg or .png"},
        Mistake{"PictureOfNothing", "bench load dip --plot load.svg", 2, "rate and size"},
        Mistake{"MissingVideo", "demo --video nowhere.avi", 3, "nowhere.avi"},
        Mistake{"MissingData", "demo --data nowhere", 3, "nowhere"},
        Mistake{"MissingConfig", "road --config nowhere.toml", 3, "nowhere.toml"},
        Mistake{"NoLink", "vehicle", 2, "--link"},
        Mistake{"BadLink", "vehicle --link lo", 2, "NIC=ADDRESS:PORT"},
        Mistake{"LinkToAName", "vehicle --link lo=localhost:47000", 2, "'localhost' is a name"},
        Mistake{"BadLinkAttribute", "vehicle --link lo=127.0.0.1:1,rol=backup", 2, "'role'"},
        Mistake{"BadRateCap", "vehicle --link lo=127.0.0.1:1,rate_cap=20", 2, "20mbit"},
        Mistake{"NicWithAddress", "road --nic lo=127.0.0.1:1", 2, "eth0,trusted"},
        Mistake{"BadPeer", "links --peer host:port", 2, "HOST:PORT"},
        Mistake{"PeerAndLink", "links --peer 127.0.0.1 --link lo=127.0.0.1:1", 2, "--peer"},
        Mistake{"IntervalWithoutStream", "links --interval 1", 2, "--json-stream"},
        Mistake{"ForWithoutMeasuring", "links --for 1", 2, "--peer"},
        Mistake{"BothJson", "links --json --json-stream", 2, "--json"},
        Mistake{"TopWithoutTerminal", "top", 2, "links --json-stream"},
        Mistake{"BadDoctorPeer", "doctor --peer host:0", 2, "HOST:PORT"},
        Mistake{"NatTimeoutOfNobody", "doctor --nat-timeout", 2, "--peer"},
        Mistake{"NatTimeoutTooShort", "doctor --peer 127.0.0.1 --nat-timeout 4", 2,
                "--nat-timeout"},
        Mistake{"NatTimeoutTooLong", "doctor --peer 127.0.0.1 --nat-timeout 241", 2,
                "--nat-timeout"},
        Mistake{"NoNic", "road", 2, "--nic"},
        Mistake{"UnknownNic", "road --insecure --nic wwan77 --ladder motion", 2, "wwan77"},
        Mistake{"RoadWithoutAKey", "road --nic lo --ladder none", 3, "run `interneuron keys gen`"},
        Mistake{"VehicleWithoutAKey", "vehicle --link lo=127.0.0.1:9", 3, "--insecure"},
        Mistake{"LinksWithoutAKey", "links --peer 127.0.0.1", 3, "run `interneuron keys gen`"},
        Mistake{"TopWithoutAKey", "top --once --peer 127.0.0.1", 3, "run `interneuron keys gen`"},
        Mistake{"MissingKey", "road --nic lo --key nowhere", 3, "keys gen --out nowhere"},
        Mistake{"KeyAndInsecure", "road --nic lo --insecure --key x", 2, "leave out --key"},
        Mistake{"TrustAndInsecure",
                "road --nic lo --insecure --trust hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=", 2,
                "leave out --trust"},
        Mistake{"TrustOfNoKey", "road --nic lo --trust abc", 2, "44 characters"},
        Mistake{"PeerKeyOfNoKey", "vehicle --link lo=127.0.0.1:9 --peer-key abc,psk=f", 2,
                "'abc,psk=f'"},
        Mistake{"KeyOfNothing", "links --insecure", 2, "add --peer HOST or --link"},
        Mistake{"PublicPeerInTheClear", "links --insecure --link lo=203.0.113.5:47000", 1,
                "203.0.113.5:47000 has a public address"},
        Mistake{"KeysOfWhat", "keys", 2, "subcommand"},
        Mistake{"PublicKeyOfNothing", "keys pub", 3, "keys gen"},
        Mistake{"PublicKeyOfNoFile", "keys pub nowhere", 3, "'nowhere' is not there"},
        Mistake{"PublicKeyOfAFolder", "keys pub /", 3, "is no regular file"},
        Mistake{"NewKeyNowhere", "keys gen --out /nowhere/key", 1, "/nowhere/key"},
        Mistake{"SignedByNobody",
                "keys sign --id bus7 hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=", 2,
                "--authority"},
        Mistake{"SignedNameTooLong",
                "keys sign --authority f --id seventeen-letters "
                "hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=",
                2, "16 letters"},
        Mistake{"SignedOnNoDay",
                "keys sign --authority f --id b --from 2027-02-30 "
                "hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=",
                2, "2027-01-31"},
        Mistake{"RevokedNoKey", "keys revoke --authority f --list g abc", 2, "44 characters"},
        Mistake{"AuthorityOfNoKey", "road --nic lo --authority abc", 2, "44 characters"},
        Mistake{"AuthorityAndInsecure",
                "road --nic lo --insecure --authority hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=",
                2, "leave out --authority"},
        Mistake{"RevocationsOfNobody", "road --nic lo --revocations f", 2, "add --authority KEY"},
        Mistake{"StaleWithoutAnAge", "road --nic lo --revocations-stale accept", 2,
                "--revocations-max-age"},
        Mistake{"RoadAddress", "road --nic lo --address nope", 2, "nope"},
        Mistake{"ProbeOfNobody", "probe", 2, "--peer"},
        Mistake{"ProbeOfABadPort", "probe --peer roadside.example:port", 2, "HOST:PORT"},
        Mistake{"ProbeOfABadNicPeer", "probe --nic lo=[::1", 2, "--nic '[::1'"},
        Mistake{"ProbeOfNoAddress", "probe --peer 0.0.0.0", 2, "0.0.0.0"},
        Mistake{"UnknownExperiment", "eval table-erods", 2, "table-erdos"},
        Mistake{"NoExperiment", "eval", 2, "EXPERIMENT"},
        Mistake{"NoRounds", "eval fig-rt --rounds 0", 2, "--rounds"},
        Mistake{"SeedsBackwards", "eval fig-rt --seeds 5..1", 2, "5..1"},
        Mistake{"SeedsOfLetters", "eval fig-rt --seeds a..b", 2, "a..b"},
        Mistake{"TooManySeeds", "eval fig-rt --seeds 1..1000000", 2, "1000000"},
        Mistake{"BothWorlds", "eval table-erdos --sim --testbed", 2, "--testbed"},
        Mistake{"OnlyVirtualTime", "eval fig-rt --testbed", 2, "on the testbed: table-erdos"},
        Mistake{"DeadlineInVirtualTime", "eval table-erdos --deadline-ms 130", 2, "--testbed"},
        Mistake{"NoDeadline", "eval table-erdos --testbed --deadline-ms 0", 2, "--deadline-ms"},
        Mistake{"OnlyInTheClear", "eval fig-rt --encrypted", 2, "those that are: table-erdos"},
        Mistake{"EvalNowhere", "eval fig-rt --out /proc/nowhere", 1, "/proc/nowhere"},
        Mistake{"ReportNowhere", "report nowhere", 3, "nowhere"},
        Mistake{"CaptureOfTwoRuns", "--pcap x.pcap", 2, "--load", places::nature()},
        Mistake{"ProbeTooOften", "probe --peer 127.0.0.1 --interval 0.5ms", 2, "--interval"},
        Mistake{"ProbeTooLarge", "probe --peer 127.0.0.1 --size 1401", 2, "--size"},
        Mistake{"ProbeOverNoNic", "probe --peer 127.0.0.1 --nic wwan77", 2, "wwan77"},
        Mistake{"StampPort", "road --nic lo --ladder motion --stamp 70000", 2, "--stamp"},
        Mistake{"TestbedNotUp", "testbed run --name nobody -- true", 1, "nobody"},
        Mistake{"DownOfNobody", "testbed down --name nobody", 1, "nobody"},
        Mistake{"VerifyOfNobody", "testbed verify --name nobody", 1, "nobody"},
        Mistake{"UnknownBackend", "testbed up --backend magic", 2, "--backend"},
        Mistake{"UnknownProfileOfATestbed", "testbed schedule --profile 6g", 2, "6g"},
        Mistake{"NameOfATestbed", "testbed up --name a/b", 2, "a/b"},
        Mistake{"PlotOfAnotherFormat", "testbed schedule --plot x.pdf", 2, ".png or .svg"},
        Mistake{"NoVehicles", "testbed up --vehicles 0", 2, "--vehicles"},
        Mistake{"NoProfileFile", "testbed up --profile ./nowhere.toml", 3, "nowhere.toml"},
        Mistake{"NoScenarioFile", "testbed up --scenario nowhere.toml", 3, "nowhere.toml"}),
    [](const auto& mistake) { return std::string(mistake.param.name); });

struct BadProfile {
  const char* lines;
  const char* says;
};

TEST(BadInput, AProfileThatIsWrongIsNamedAndNothingIsLeft) {
  const TempFolder folder;
  std::ofstream(folder / "cut.rtt") << "# Source: a test\n# step_s = 1\n50\n60\n7";  // no newline
  const std::string file = (folder / "bad.toml").string();
  const std::string ends = "[up]\nrate_mbit = 10\n[down]\nrate_mbit = 10\n";
  for (const BadProfile& bad :
       {BadProfile{"model = \"constant\"\nrtt_ms = 20\nloss = 0\nlos = 1\n", "did you mean 'loss'"},
        BadProfile{"model = \"constant\"\nrtt_ms = 20\nloss = 7\n", "out of range"},
        BadProfile{"model = \"delay-trace\"\nloss = 0\nrtt_trace = \"none.rtt\"\n", "none.rtt"},
        BadProfile{"model = \"delay-trace\"\nloss = 0\nrtt_trace = \"cut.rtt\"\n", "cut.rtt"}}) {
    std::ofstream(file) << "schema = 1\nname = \"bad\"\ndescription = \"bad\"\n"
                        << bad.lines << ends;
    const Ran ran = run("testbed up --name never --profile bad=" + file);
    EXPECT_EQ(ran.code, 3) << ran.output;
    EXPECT_NE(ran.output.find(bad.says), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
  EXPECT_EQ(run("testbed status --name never").code, 1);
}

TEST(BadInput, AModelThatIsNotThere) {
  const TempFolder data;
  EXPECT_THAT(run("road --insecure --nic lo --ladder dnn --data '" + data.string() + "'"),
              EndsSaying(3, "fetch_data.sh"));
}

TEST(BadInput, AnAbsentRoadsideUnitIsNamed) {
  const Ran ran =
      run("vehicle --insecure --link lo=127.0.0.1:9 --wait-s 0.5 --ladder motion -q --video "
          "'" +
          places::source() + "/docs/latency.png'");
  EXPECT_EQ(ran.code, 1) << ran.output;
  EXPECT_NE(ran.output.find("no roadside unit answered"), std::string::npos) << ran.output;
  EXPECT_NE(ran.output.find("lo=127.0.0.1:9"), std::string::npos) << ran.output;
}

TEST(BadInput, HelpAndVersionAreFine) {
  for (const char* arguments :
       {"--help", "demo --help", "vehicle --help", "road --help", "testbed --help", "version",
        "links --help", "top --help", "keys --help", "keys gen --help", "doctor --help",
        "probe --help", "eval --help", "report --help"}) {
    EXPECT_EQ(run(arguments).code, 0) << arguments;
  }
  EXPECT_EQ(run_program(places::nature(), "--help").code, 0);
  const Ran version = run("--version");
  EXPECT_EQ(version.code, 0);
  EXPECT_EQ(version.output, run("version").output);
}

}  // namespace
}  // namespace interneuron::cli::bad_input_test
