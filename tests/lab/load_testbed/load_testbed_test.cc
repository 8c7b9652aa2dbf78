// `interneuron bench load --testbed`: a short run with each transport, and that nothing is left
// when it is interrupted.
#include <fstream>
#include <iterator>

#include "lab/load_testbed/run.h"
#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::load_testbed::load_testbed_test {
namespace {

using cli::no_testbed;
using cli::Ran;
using cli::run;
using cli::run_program;
using cli::TempFolder;
using load::Peer;

TEST(LoadTestbed, SaysWhichPeersItHas) {
  const Ran model = run("bench load rate --testbed --peer cubic");
  EXPECT_EQ(model.code, 2) << model.output;
  EXPECT_NE(model.output.find("tcp_cubic"), std::string::npos) << model.output;
  EXPECT_EQ(run("bench load rate --peer tcp_cubic").code, 2);
}

// How many processes have this in their command line.
int processes_with(const std::string& text) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    std::ifstream file(entry.path() / "cmdline");
    const std::string line{std::istreambuf_iterator<char>(file), {}};
    if (line.find(text) != std::string::npos) ++count;
  }
  return count;
}

class LoadTestbedRun : public testing::TestWithParam<Peer> {};

TEST_P(LoadTestbedRun, GivesARowOfTheSchema) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  if (const auto reason = lacks(GetParam())) GTEST_SKIP() << *reason;
  const Ran ran = run("bench load late --testbed --seconds 1 --json --peer " +
                          std::string(load::name_of(GetParam())),
                      false);
  ASSERT_EQ(ran.code, 0) << ran.output;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  ASSERT_FALSE(document.is_discarded()) << ran.output.substr(0, 200);
  for (const auto& violation : watch::violations(watch::schema_of("load.json"), document)) {
    ADD_FAILURE() << violation;
  }
  EXPECT_EQ(document["mode"], "testbed");
  ASSERT_EQ(document["rows"].size(), 1U);
  const auto& row = document["rows"][0];
  // Nine vehicles begin at once, the tenth later; twice what the cell carries.
  EXPECT_GT(row["messages"], 200);
  EXPECT_GT(row["utilisation"], 0.5);
  EXPECT_GT(row["road_cpu_percent"], 0);
  // The queue cannot be longer than its bytes take.
  EXPECT_LE(row["queue_p99_ms"], row["queue_ms"].get<double>() + 1);
  EXPECT_GT(row["queue_p99_ms"], 0);
}

// The only row of a run of ours; an empty object when there is none.
nlohmann::json row_of_ours(const std::string& options) {
  const Ran ran = run("bench load --testbed --peer ours --json " + options, false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  if (document.is_discarded() || document["rows"].empty()) return nlohmann::json::object();
  for (const auto& violation : watch::violations(watch::schema_of("load.json"), document)) {
    ADD_FAILURE() << violation;
  }
  return document["rows"][0];
}

// The flow of the kernel's TCP takes what it can get, from before the messages on.
TEST(LoadTestbed, CrossTrafficOfTheKernelSharesTheCell) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const auto row = row_of_ours("cubic --seconds 2");
  ASSERT_TRUE(row.contains("cross_share"));
  EXPECT_EQ(row["cross"], "cubic");
  EXPECT_GT(row["cross_share"], 0.2);
  EXPECT_LT(row["cross_share"], 2.1);
  EXPECT_GT(row["own_share"].get<double>() + row["cross_share"].get<double>(), 0.5);
}

// 128 KiB take 180 ms at the rate of the dip: none of its 30 whole messages can be on time.
TEST(LoadTestbed, TheRateFallsAndComesBack) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const auto row = row_of_ours("dip --seconds 1");
  ASSERT_TRUE(row.contains("missed"));
  EXPECT_GT(row["missed"], 20);
  EXPECT_LT(row["missed"], 90);
  EXPECT_TRUE(row["whole_after_ms"].is_number()) << row.dump();
}

INSTANTIATE_TEST_SUITE_P(Peers, LoadTestbedRun,
                         testing::Values(Peer::kOurs, Peer::kUdp, Peer::kTcpCubic, Peer::kMptcp),
                         [](const auto& test) { return std::string(load::name_of(test.param)); });

TEST(LoadTestbed, LeavesNothingWhenItIsInterrupted) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const TempFolder folder;
  const Ran ran = run_program(
      "env", "TMPDIR='" + folder.string() + "' timeout --preserve-status -s INT 3 '" +
                 places::program() + "' bench load late --testbed --peer ours --seconds 60");
  EXPECT_EQ(ran.code, 130) << ran.output;
  EXPECT_TRUE(std::filesystem::is_empty(folder.string())) << ran.output;
  // The programs of a run have its folder on their command line.
  EXPECT_EQ(processes_with(folder.string()), 0);
}

}  // namespace
}  // namespace interneuron::load_testbed::load_testbed_test
