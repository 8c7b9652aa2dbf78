// `interneuron bench peers`: short runs on a testbed, their JSON and their table, and that nothing
// is left when it is interrupted.
#include <fstream>

#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli::bench_peers_test {
namespace {

using nlohmann::json;

// A document of the schema.
json checked(const std::string& output) {
  json document = json::parse(output, nullptr, false);
  EXPECT_FALSE(document.is_discarded()) << output.substr(0, 200);
  for (const auto& violation : watch::violations(watch::schema_of("peers.json"), document)) {
    ADD_FAILURE() << violation;
  }
  return document;
}

json compared(const std::string& arguments) {
  const Ran ran = run("bench peers " + arguments + " --json", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  return checked(ran.output);
}

TEST(BenchPeers, RefusesWhatThereIsNot) {
  for (const char* arguments :
       {"nowhere", "clean --peer nobody", "clean --size 10", "clean --plot x.gif",
        "clean --deadline 0", "clean --messages 0", "clean --seconds 0", "--seconds 5 --messages 5",
        "--quick clean", "--quick --peer udp"}) {
    EXPECT_EQ(run(std::string("bench peers ") + arguments).code, 2) << arguments;
  }
}

TEST(BenchPeers, ANamedFolderThatIsMissingIsToldBeforeAnyRun) {
  for (const char* option : {"--page", "--plot"}) {
    EXPECT_THAT(run(std::string("bench peers clean --peer udp ") + option + " nowhere/at/all.svg"),
                EndsSaying(3, "nowhere/at"));
  }
}

TEST(BenchPeers, ItsHelpNamesScenariosAndPeers) {
  const Ran help = run("bench peers --help");
  EXPECT_EQ(help.code, 0);
  for (const char* text :
       {"drive-lte-highway", "ours_down_sampling", "ours_failover", "mptcp", "Examples:"}) {
    EXPECT_NE(help.output.find(text), std::string::npos) << text << "\n" << help.output;
  }
  EXPECT_EQ(run("bench --help").output.find("play"), std::string::npos);
}

TEST(BenchPeers, WritesARowForEachDeadline) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const json document =
      compared("clean --size 5KB --messages 5 --seed 3 --peer udp --deadline 150,300");
  ASSERT_EQ(document["rows"].size(), 2U);
  for (const json& row : document["rows"]) {
    EXPECT_EQ(row["messages"], 5);
    EXPECT_EQ(row["message_bytes"], 5000);
    EXPECT_EQ(row["seed"], 3);
  }
  EXPECT_EQ(document["rows"][0]["deadline_ms"], 150);
  EXPECT_EQ(document["rows"][1]["deadline_ms"], 300);
}

TEST(BenchPeers, ALengthSaysHowManyMessagesThereAre) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const json document = compared("clean --size 1MB --seconds 1 --peer udp --deadline 300");
  ASSERT_EQ(document["rows"].size(), 1U);
  EXPECT_EQ(document["rows"][0]["messages"], 2);
}

class BenchPeersRun : public testing::TestWithParam<const char*> {};

// Few messages over links without faults, and a deadline that leaves time: what a peer is worth is
// for the bench to say. They are large enough for the trains of packets that measure a link before
// the first of them, on a busy machine also among them, to be a small part of what is sent.
TEST_P(BenchPeersRun, GivesARowOfTheSchema) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const Ran ran =
      run(std::string("bench peers clean --size 20KB --messages 10 --deadline 300 --json --peer ") +
              GetParam(),
          false);
  if (ran.code == 77) GTEST_SKIP() << "this build or this machine lacks it";
  ASSERT_EQ(ran.code, 0) << ran.output;
  const json document = checked(ran.output);
  ASSERT_EQ(document["rows"].size(), 1U);
  const json& row = document["rows"][0];
  EXPECT_EQ(row["peer"], GetParam());
  EXPECT_EQ(row["messages"], 10);
  EXPECT_LT(row["missed"], 5);
  EXPECT_GT(row["cpu_us_send"], 0);
  EXPECT_GT(row["cpu_us_receive"], 0);
  // One way takes 15 ms over the faster link.
  EXPECT_GE(row["p50_ms"], 15);
  EXPECT_GT(row["wire_ratio"], 1);
  EXPECT_LT(row["wire_ratio"], 4);
}

// UDP and TCP over one link are in the cases beneath.
INSTANTIATE_TEST_SUITE_P(Peers, BenchPeersRun,
                         testing::Values("ours_best_link", "ours_duplicate", "ours_down_sampling",
                                         "ours_coded", "ours_stripe", "ours_shadow",
                                         "ours_failover", "udp_duplicate", "mptcp", "srt_backup",
                                         "srt_broadcast", "fastdds_stock", "fastdds_tuned"),
                         [](const auto& test) { return std::string(test.param); });

TEST(BenchPeers, OursPassesThroughTheTransportThatIsAskedFor) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const std::string few = "clean --size 5KB --messages 10 --deadline 300 --peer ours_best_link";
  const json document = compared(few + " --transport ring");
  EXPECT_EQ(document["transport"], "ring");
  EXPECT_LT(document["rows"][0]["missed"], 5);
  EXPECT_THAT(run("bench peers " + few + " --transport pigeon"), EndsSaying(2, "--transport"));
  // Nothing passes through a transport in virtual time.
  EXPECT_EQ(run("bench load rate --load 1 --seconds 1 --transport ring").code, 2);
}

TEST(BenchPeers, ShowsATable) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const Ran ran = run("bench peers clean --size 5KB --messages 5 --peer tcp --deadline 200", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  for (const char* text : {"clean:", "5 messages of 5000 bytes", "missed 200 ms", "tcp", "wire"}) {
    EXPECT_NE(ran.output.find(text), std::string::npos) << text << "\n" << ran.output;
  }
}

TEST(BenchPeers, DrawsItsPictureAndWritesItsPage) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const TempFolder folder;
  const std::string file = (folder / "peers.svg").string();
  const std::string page = (folder / "peers.md").string();
  const Ran ran = run("bench peers clean --size 5KB,128KiB --messages 5 --peer udp --plot '" +
                      file + "' --page '" + page + "'");
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_GT(std::filesystem::file_size(file), 1000U);
  std::ifstream in(page);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  for (const char* words : {"clean, 5 KB, 300 ms, 5 messages", "clean, 128 KiB", "| `udp` |"}) {
    EXPECT_NE(text.find(words), std::string::npos) << words << "\n" << text;
  }
}

TEST(BenchPeers, AHoleStopsTheFirstLinkInMidRun) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  // It lasts longer than what is left of the run.
  const json document =
      compared("hole --size 5KB --messages 20 --peer udp,udp_duplicate --deadline 300");
  ASSERT_EQ(document["rows"].size(), 2U);
  EXPECT_GE(document["rows"][0]["missed"], 8);
  EXPECT_LE(document["rows"][0]["missed"], 12);
  EXPECT_LT(document["rows"][1]["missed"], 8);
  const json& numbers = document["rows"][0]["missed_numbers"];
  ASSERT_EQ(numbers.size(), document["rows"][0]["missed"]);
  EXPECT_EQ(numbers.back(), 19);
}

TEST(BenchPeers, LeavesNothingWhenItIsInterrupted) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const TempFolder folder;
  const Ran ran =
      run_program("env", "TMPDIR='" + folder.string() + "' timeout --preserve-status -s INT 3 '" +
                             places::program() + "' bench peers clean --peer ours_duplicate");
  EXPECT_EQ(ran.code, 130) << ran.output;
  EXPECT_TRUE(std::filesystem::is_empty(folder.string())) << ran.output;
}

// The signal comes once the second run has begun.
TEST(BenchPeers, ShowsWhatItHasWhenItIsInterrupted) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const TempFolder folder;
  std::ofstream(folder / "script") << R"sh(cd "$(dirname "$0")"
set -m
"$1" bench peers clean --size 5KB --messages 1 --deadline 100 --peer udp,tcp --json --page page > rows 2> told &
until grep -q "run 2 of 2" told || ! kill -0 $!; do sleep 0.05; done
kill -INT $!
wait $!
code=$?
cat rows
exit $code
)sh";
  const Ran ran =
      run_program("bash", (folder / "script").string() + " '" + places::program() + "'", false);
  EXPECT_EQ(ran.code, 130) << ran.output;
  const json document = checked(ran.output);
  ASSERT_EQ(document["rows"].size(), 1U);
  EXPECT_EQ(document["rows"][0]["peer"], "udp");
  EXPECT_FALSE(std::filesystem::exists(folder / "page"));
}

}  // namespace
}  // namespace interneuron::cli::bench_peers_test
