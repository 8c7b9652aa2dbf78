// `interneuron bench coding`, `bench drives` and `bench transports`: their JSON and their tables.
#include <fstream>
#include <iterator>
#include <string>
#include <variant>

#include "lab/coding/drives.h"
#include "lab/emu/profile.h"
#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli::bench_coding_test {
namespace {

using nlohmann::json;

json checked(const std::string& command, const char* schema) {
  const Ran ran = run(command + " --json", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  json document = json::parse(ran.output, nullptr, false);
  EXPECT_FALSE(document.is_discarded()) << ran.output.substr(0, 200);
  for (const auto& violation : watch::violations(watch::schema_of(schema), document))
    ADD_FAILURE() << violation;
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
  EXPECT_THAT(run("bench coding clean --messages 20"), EndsSaying(0, "coded"));
  EXPECT_EQ(run("bench coding nothing").code, 2);
  EXPECT_EQ(run("bench coding --policy nobody").code, 2);
}

TEST(BenchDrives, WritesARowForEachDrive) {
  const json document = checked(
      "bench drives --drives 2 --messages 40 --policy stripe,coded --seed 7", "drives.json");
  ASSERT_EQ(document["rows"].size(), 2U);
  EXPECT_EQ(document["rows"][0]["alone_missed"].size(), 2U);
  EXPECT_EQ(document["rows"][1]["policies"][1]["policy"], "coded");
}

TEST(BenchDrives, ShowsWhatImagesBring) {
  const json document =
      checked("bench drives --images --drives 2 --messages 40 --seed 2", "image_drives.json");
  ASSERT_EQ(document["rows"].size(), 2U);
  const json& ways = document["rows"][0]["ways"];
  ASSERT_EQ(ways.size(), 2U);
  EXPECT_EQ(ways[0]["by_variant"].size(), 2U);
  EXPECT_EQ(ways[1]["by_variant"].size(), 4U);
  EXPECT_GT(ways[1]["ours"]["quality"], ways[0]["ours"]["quality"]);
  const Ran table = run("bench drives --images --drives 1 --messages 20");
  EXPECT_NE(table.output.find("jpeg: "), std::string::npos) << table.output;
  EXPECT_EQ(run("bench drives --images --policy coded").code, 2);
}

// The profiles are read back as the modems that they were.
TEST(BenchDrives, WritesDrivesAsProfiles) {
  const TempFolder folder;
  const Ran ran = run("bench drives --seed 3 --drives 2 --profiles " + folder.string());
  ASSERT_EQ(ran.code, 0) << ran.output;
  const auto text_of = [&](const std::string& name) {
    std::ifstream in(folder / name);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const coding::Drive drive = coding::generated_drive(4);
  for (std::size_t i = 0; i < drive.modems.size(); ++i) {
    const std::string name = "4-" + std::to_string(i + 1);
    const auto parsed = emu::parse_profile(
        text_of(name + ".toml"), name,
        [&](const std::string& file) -> std::variant<std::string, emu::FileError> {
          return text_of(file);
        });
    ASSERT_TRUE(std::holds_alternative<emu::LinkProfile>(parsed))
        << std::get<emu::ProfileError>(parsed).what;
    const auto& profile = std::get<emu::LinkProfile>(parsed);
    const emu::LinkProfile modem = coding::profile_of(drive.modems[i]);
    EXPECT_EQ(profile.delay.min_ms, modem.delay.min_ms);
    EXPECT_EQ(profile.up.rate.bits_per_second, modem.up.rate.bits_per_second);
    EXPECT_EQ(profile.up.queue_bytes, modem.up.queue_bytes);
    EXPECT_EQ(profile.down.rate.bits_per_second, modem.down.rate.bits_per_second);
  }
  EXPECT_EQ(run("bench drives --profiles /proc/nothing --drives 1").code, 1);
}

TEST(BenchDrives, TakesTracesAndNamesWhatIsWrongWithThem) {
  const TempFolder folder;
  const auto write = [&](const char* name, const char* text) {
    std::ofstream(folder / name) << text;
    return (folder / name).string();
  };
  std::string steady;
  for (int ms = 1; ms <= 1000; ++ms) steady += std::to_string(ms) + "\n";
  const std::string good = write("drives-good.up", steady.c_str());
  const std::string bad = write("drives-bad.up", "1\ntwo\n");
  EXPECT_THAT(run("bench drives " + good + "," + good + " --drives 1 --messages 30"),
              EndsSaying(0, "drives-good.up + drives-good.up"));
  EXPECT_THAT(run("bench drives " + bad), EndsSaying(3, "drives-bad.up: line 2"));
  EXPECT_EQ(run("bench drives /nonexistent.up").code, 3);
  EXPECT_EQ(run("bench drives --policy nobody").code, 2);
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
}  // namespace interneuron::cli::bench_coding_test
