// `interneuron bench coding` and `bench transports`: their JSON and their tables.
#include "support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli {
namespace {

using nlohmann::json;

json checked(const std::string& command, const char* schema) {
  const Ran ran = run(command + " --json", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  json document = json::parse(ran.output, nullptr, false);
  EXPECT_FALSE(document.is_discarded()) << ran.output.substr(0, 200);
  for (const auto& violation : violations(schema_of(schema), document)) ADD_FAILURE() << violation;
  return document;
}

TEST(BenchCoding, WritesARowForEachPolicy) {
  const json document = checked(
      "bench coding losses hole --policy coded,duplicate --messages 70 --seed 4", "coding.json");
  ASSERT_EQ(document["rows"].size(), 4U);
  EXPECT_EQ(document["seed"], 4);
  EXPECT_EQ(document["rows"][0]["messages"], 70);
  EXPECT_EQ(document["rows"][2]["scenario"], "hole");
  EXPECT_EQ(document["rows"][2]["messages"], 40 * 70);
  EXPECT_GT(document["rows"][1]["wire_ratio"], 2);
}

TEST(BenchCoding, ShowsATable) {
  const Ran ran = run("bench coding clean --messages 20");
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_NE(ran.output.find("coded"), std::string::npos) << ran.output;
  EXPECT_EQ(run("bench coding nothing").code, 2);
  EXPECT_EQ(run("bench coding --policy nobody").code, 2);
}

TEST(BenchTransports, WritesARowForEachTransportAndLoad) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  const json document = checked("bench transports --seconds 0.1", "transports.json");
  ASSERT_EQ(document["rows"].size(), 9U);
  for (const json& row : document["rows"]) {
    // AF_XDP needs root of the host; the row says so.
    if (row["transport"] == "xdp" && row["failure"] != "") continue;
    EXPECT_EQ(row["failure"], "");
    EXPECT_GT(row["datagrams"], 0);
    EXPECT_GT(row["cpu_us_send"], 0);
  }
}

}  // namespace
}  // namespace interneuron::cli
