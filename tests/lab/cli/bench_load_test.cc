// `interneuron bench load`: its JSON, its tables and its picture.

#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli::bench_load_test {
namespace {

TEST(BenchLoad, WritesRowsOfItsSchema) {
  const Ran rate = run("bench load rate size --load 1.05 --seconds 1 --seed 3 --json", false);
  ASSERT_EQ(rate.code, 0) << rate.output;
  const auto document = nlohmann::json::parse(rate.output, nullptr, false);
  ASSERT_FALSE(document.is_discarded()) << rate.output.substr(0, 200);
  for (const auto& violation : watch::violations(watch::schema_of("load.json"), document)) {
    ADD_FAILURE() << violation;
  }
  EXPECT_GE(document["rows"].size(), 4U);
  for (const auto& row : document["rows"]) {
    EXPECT_EQ(row["load"], 1.05);
    EXPECT_EQ(row["seed"], 3);
  }
}

// The row of a crowd in a short run.
nlohmann::json crowd(const std::string& options) {
  const Ran ran = run("bench load late --peer ours --seconds 1 --json " + options, false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  return document.is_discarded() ? nlohmann::json::object() : document["rows"][0];
}

TEST(BenchLoad, JoinsOneAfterTheOtherAndEncryptedUnlessToldOtherwise) {
  const auto now = crowd("");
  EXPECT_EQ(now["encrypted"], true);
  EXPECT_EQ(now["together"], false);
  EXPECT_EQ(crowd("--encrypted"), now);
  const auto old = crowd("--together --clear");
  EXPECT_EQ(old["encrypted"], false);
  EXPECT_EQ(old["together"], true);
  EXPECT_EQ(run("bench load --clear --encrypted").code, 2);
}

TEST(BenchLoad, ShowsATableForEachGroup) {
  const Ran ran = run("bench load --peer ours rate dip --seconds 1", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  for (const char* text : {"rate:", "dip:", "20mbit-30ms", "queue p99"}) {
    EXPECT_NE(ran.output.find(text), std::string::npos) << text << "\n" << ran.output;
  }
  EXPECT_EQ(ran.output.find("size:"), std::string::npos) << ran.output;
}

TEST(BenchLoad, DrawsItsPicture) {
  const TempFolder folder;
  for (const char* name : {"load.svg", "load.png"}) {
    const std::string file = (folder / name).string();
    const Ran ran = run("bench load size --peer ours --seconds 1 --plot '" + file + "'");
    EXPECT_EQ(ran.code, 0) << ran.output;
    EXPECT_GT(std::filesystem::file_size(file), 1000U) << name;
  }
}

}  // namespace
}  // namespace interneuron::cli::bench_load_test
