// `interneuron eval`: what it writes, what it says of the rows, and that it leaves nothing behind
// when it fails.
#include <fstream>
#include <iterator>

#include "app/process/progress.h"
#include "app/process/signals.h"
#include "app/records/staging.h"
#include "lab/cli/eval/experiments.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/findings.h"
#include "lab/eval/experiments/scorer.h"
#include "lab/eval/system.h"
#include "lab/report/page.h"
#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli::eval_test {
namespace {

using experiments::Column;
using experiments::Document;
using experiments::Experiment;
using experiments::Finding;
using experiments::kVideoFrames;
using experiments::Scorer;
using experiments::ShownRound;
using experiments::SystemRow;
using records::Staging;

namespace fs = std::filesystem;

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder)) out.push_back(entry.path().filename());
  std::ranges::sort(out);
  return out;
}

nlohmann::json document_of(const std::string& arguments) {
  const TempFolder folder;
  const Ran ran =
      run("eval " + arguments + " --json --out '" + (folder / "out").string() + "'", false);
  EXPECT_EQ(ran.code, 0) << ran.output;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  EXPECT_FALSE(document.is_discarded()) << ran.output.substr(0, 200);
  for (const std::string& violation : watch::violations(watch::schema_of("eval.json"), document)) {
    ADD_FAILURE() << violation;
  }
  return document;
}

TEST(Eval, FigRtShowsEveryPhaseOfThePaper) {
  const auto document = document_of("fig-rt");
  const auto& rows = document["tables"][0]["rows"];
  ASSERT_EQ(rows.size(), 13U);
  for (const auto& row : rows) {
    const int round = row["round"];
    EXPECT_EQ(row["image"], round < 5 ? "raw" : "sampled") << round;
    EXPECT_EQ(row["at_d1"], round >= 5 && round <= 7) << round;
    EXPECT_EQ(row["d1_missed"], round >= 8) << round;
    EXPECT_EQ(row["d2_missed"], round >= 11) << round;
    EXPECT_LT(row["theta1_ms"], row["theta2_ms"]) << round;
    EXPECT_LT(row["theta2_ms"], row["theta3_ms"]) << round;
  }
  ASSERT_EQ(document["waterfalls"].size(), 2U);
  for (const auto& waterfall : document["waterfalls"]) {
    // Raw over one link, sampled over the other, the result over both.
    EXPECT_GE(waterfall["sends"].size(), 4U);
    for (const auto& send : waterfall["sends"]) EXPECT_FALSE(send["sent_ms"].empty());
  }
}

TEST(Eval, TableNetworkMeasuresThePapersDelays) {
  const auto document = document_of("table-network --rounds 6000 --seeds 1..8");
  for (const auto& row : document["tables"][0]["rows"]) {
    const double paper = row["paper_rtt_ms"]["avg"];
    EXPECT_NEAR(row["rtt_ms"]["avg"], paper, 0.25 * paper) << row["name"];  // 80 minutes of drive
    EXPECT_GE(row["rtt_ms"]["min"], row["paper_rtt_ms"]["min"]) << row["name"];
  }
}

TEST(Eval, TableErdosHasARowPerSystemAndBound) {
  const auto document = document_of("table-erdos --rounds 40 --seeds 3..4");
  EXPECT_EQ(document["seeds"], nlohmann::json({3, 4}));
  for (const auto& table : document["tables"]) {
    if (table["name"] == "paper") continue;
    std::vector<std::string> names;
    for (const auto& row : table["rows"]) {
      names.push_back(row["name"]);
      for (const char* key :
           {"guard", "policy", "seeds", "rounds", "timeouts", "timeouts_ci95", "consecutive",
            "e2e_ms", "ap", "ar", "effective_ap", "bytes", "oracle", "quality"}) {
        EXPECT_TRUE(row.contains(key)) << names.back() << " " << key;
      }
      EXPECT_EQ(row["rounds"], 80) << names.back();
      EXPECT_GE(row["timeouts"], row["oracle"]["timeouts"]) << names.back();
      EXPECT_LE(row["quality"], row["oracle"]["quality"].get<double>() + 1e-9) << names.back();
    }
    for (const char* name : {"ours", "paper", "erdos_like", "erdos_e2e", "duplicate", "oracle"}) {
      EXPECT_TRUE(std::ranges::count(names, name) == 1) << name << " in " << table["name"];
    }
  }
}

TEST(Eval, TableLidarHasBothSweepsAndAStaticChoicePerVariant) {
  const auto document = document_of("table-lidar --rounds 20 --seeds 3..4");
  ASSERT_EQ(document["tables"].size(), 6U);
  for (const auto& table : document["tables"]) {
    std::vector<std::string> names;
    for (const auto& row : table["rows"]) {
      names.push_back(row["name"]);
      EXPECT_TRUE(row["ap"].is_null()) << names.back();
      EXPECT_TRUE(row.contains("effective_agreement")) << names.back();
      EXPECT_EQ(row["rounds"], 40) << names.back();
      EXPECT_GE(row["timeouts"], row["oracle"]["timeouts"]) << names.back();
      EXPECT_LE(row["quality"], row["oracle"]["quality"].get<double>() + 1e-9) << names.back();
    }
    for (const char* name : {"ours", "ours_joint", "paper", "erdos_like", "always_full",
                             "always_10cm", "always_20cm", "always_40cm", "oracle"}) {
      EXPECT_EQ(std::ranges::count(names, name), 1) << name << " in " << table["name"];
    }
  }
}

TEST(Eval, TheSameSeedsGiveTheSameFile) {
  const std::string arguments = "timeout-handler --rounds 30 --seeds 1..2";
  EXPECT_EQ(document_of(arguments), document_of(arguments));
}

TEST(Eval, WritesItsFileAndNothingElse) {
  const TempFolder folder;
  const fs::path out = folder / "deep/er";
  const Ran ran = run("eval fig-rt --out '" + out.string() + "'");
  EXPECT_EQ(ran.code, 0) << ran.output;
  EXPECT_EQ(names_in(out), std::vector<std::string>{"fig-rt.json"});
  EXPECT_NE(ran.output.find("θ1 = D1"), std::string::npos) << ran.output;
}

TEST(Eval, InterruptedItLeavesNothing) {
  const TempFolder folder;
  const std::string command = "timeout --preserve-status -s INT 2 '" + places::program() +
                              "' eval sweep --rounds 300 --seeds 1..2000 --out '" +
                              (folder / "out").string() + "' >/dev/null 2>&1";
  const int status = std::system(command.c_str());
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_TRUE(names_in(folder.string()).empty());
}

TEST(Eval, AFolderWithoutDetectionsThatWasNamedIsAnError) {
  const TempFolder folder;
  for (const char* data : {"empty", "nowhere"}) {
    fs::create_directories(folder / "empty");
    const Ran ran = run("eval fig-rt --data '" + (folder / data).string() + "' --out '" +
                        (folder / "out").string() + "'");
    EXPECT_EQ(ran.code, 3) << ran.output;
    EXPECT_NE(ran.output.find(data), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
    EXPECT_FALSE(fs::exists(folder / "out"));
  }
}

TEST(Eval, TheUsersPageNamesEveryExperiment) {
  std::ifstream file(places::source() + "/docs/evaluation.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  for (const Experiment& experiment : all_experiments()) {
    const std::string row = std::string("| `") + experiment.name + "` |";
    EXPECT_NE(page.find(row), std::string::npos) << experiment.name;
  }
  for (const auto& system : eval::systems()) {
    EXPECT_NE(page.find("`" + system.name + "`"), std::string::npos) << system.name;
  }
}

TEST(EvalStaging, PublishesAllOrNothing) {
  const TempFolder folder;
  {
    const Staging staging(folder / "a/b");
    std::ofstream(staging / "x.json") << "half";
  }
  EXPECT_FALSE(fs::exists(folder / "a"));
  fs::create_directories(folder / "a");
  std::ofstream(folder / "a/old.json") << "old";
  {
    Staging staging(folder / "a");
    std::ofstream(staging / "x.json") << "whole";
    staging.publish();
  }
  EXPECT_EQ(names_in(folder / "a"), (std::vector<std::string>{"old.json", "x.json"}));
}

TEST(EvalDocument, CellsAsPeopleReadThem) {
  const records::Json row{
      {"share", 0.0512}, {"ci", {0.01, 0.25}}, {"n", 7}, {"none", nullptr}, {"b", true}};
  const auto text = [&row](const Column& column) { return experiments::cell_text(row, column); };
  EXPECT_EQ(text({"/share", "", 1, true}), "5.1");
  EXPECT_EQ(text({"/ci", "", 1, true}), "1.0 to 25.0");
  EXPECT_EQ(text({"/n", "", 2}), "7");
  EXPECT_EQ(text({"/none", ""}), "–");
  EXPECT_EQ(text({"/other/key", ""}), "–");
  EXPECT_EQ(text({"/b", ""}), "yes");
}

SystemRow system_row(const std::string& name, std::uint64_t timeouts, double low, double high,
                     double quality) {
  SystemRow row;
  row.name = name;
  row.baseline = name != "ours" && name != "oracle";
  row.rounds = 3000;
  row.timeouts = timeouts;
  row.timeouts_ci95 = {low, high};
  row.timeouts_share = static_cast<double>(timeouts) / 3000;
  row.quality = quality;
  return row;
}

std::size_t count(const std::vector<Finding>& all, Finding::Kind kind) {
  return static_cast<std::size_t>(
      std::ranges::count_if(all, [kind](const Finding& f) { return f.kind == kind; }));
}

Document erdos_document(std::vector<SystemRow> rows) {
  Document document;
  document.experiment = "table-erdos";
  document.mode = "sim";
  document.tables.push_back({"uniform", "Uniform", "", {}, std::move(rows)});
  return document;
}

TEST(EvalDocument, IsReadAsItWasWritten) {
  Document document = erdos_document({system_row("ours", 10, 0.002, 0.006, 0.39)});
  document.seeds = {3, 4};
  SystemRow& row = std::get<std::vector<SystemRow>>(document.tables[0].rows)[0];
  row.guard = "budget";
  row.oracle = {1, 0.4, std::nullopt};
  row.bytes = {1500, 1.5, {{"5g", 1000}, {"4g", 500}}};
  document.series.push_back({"ours", "ms", {{0, 98.25, true}, {1, 130, false}}});
  document.series.push_back({"4g", "ms", {{0.5, 98.25, {}}}});
  const records::Json json = to_json(document);
  EXPECT_EQ(json["tables"][0]["rows"][0]["policy"], nullptr);
  EXPECT_FALSE(json["tables"][0]["rows"][0].contains("deadline_ms"));
  EXPECT_EQ(json["series"][0]["points"].dump(), "[[0,98.25,1],[1,130.0,0]]");
  EXPECT_EQ(to_json(experiments::document_from(json)).dump(), json.dump());
  records::Json other = json;
  other["tables"][0]["rows"][0].erase("timeouts");
  EXPECT_ANY_THROW(experiments::document_from(other));
}

TEST(EvalHeadline, SaysWhoWinsByHowMuch) {
  const auto says = report::headline(erdos_document(
      {system_row("ours", 30, 0.005, 0.015, 0.36), system_row("erdos_like", 1500, 0.48, 0.52, 0.2),
       system_row("b0", 1600, 0.5, 0.56, 0.3), system_row("oracle", 0, 0, 0.001, 0.4)}));
  ASSERT_EQ(says.size(), 3U);
  EXPECT_NE(says[0].find("3000 rounds"), std::string::npos) << says[0];
  EXPECT_EQ(says[1], "Ours misses 1.0 % of the rounds, erdos_like 50.0 %: 98 % fewer.");
  EXPECT_EQ(says[2],
            "Its answers have quality (expected AP) 0.360, 20 % more than those of the best "
            "baseline, b0 (0.300); an oracle that knows every delay beforehand reaches 0.400.");
  EXPECT_TRUE(report::headline(erdos_document({})).empty());
}

TEST(EvalFindings, SayWhereTheAimsAreMet) {
  const auto all = findings(erdos_document({system_row("ours", 10, 0.002, 0.006, 0.39),
                                            system_row("erdos_like", 1500, 0.48, 0.52, 0.25),
                                            system_row("oracle", 0, 0, 0.001, 0.395)}));
  EXPECT_EQ(count(all, Finding::Kind::kMissed), 0U);
  EXPECT_EQ(count(all, Finding::Kind::kNotice), 0U);
  EXPECT_EQ(count(all, Finding::Kind::kMet), 5U);
}

TEST(EvalFindings, SayThatABaselineWins) {
  const auto all = findings(erdos_document({system_row("ours", 900, 0.29, 0.31, 0.20),
                                            system_row("erdos_like", 950, 0.30, 0.33, 0.25),
                                            system_row("oracle", 0, 0, 0.001, 0.39)}));
  const auto says = [&all](const char* text) {
    return std::ranges::any_of(all, [text](const Finding& f) {
      return f.kind != Finding::Kind::kMet && f.text.find(text) != std::string::npos;
    });
  };
  EXPECT_TRUE(says("with no less quality than ours (0.2000): erdos_like (0.2500)"));
  EXPECT_TRUE(says("erdos_like (950): the 95 % intervals overlap"));
  EXPECT_TRUE(says("fewer timeouts than erdos_like"));
  EXPECT_TRUE(says("% of the oracle's quality"));
}

TEST(EvalFindings, SayThatABaselineIsClose) {
  const auto all = findings(erdos_document({system_row("ours", 10, 0.002, 0.006, 0.39),
                                            system_row("always_sampled", 90, 0.02, 0.04, 0.38),
                                            system_row("b0", 1500, 0.48, 0.52, 0.30)}));
  ASSERT_EQ(count(all, Finding::Kind::kNotice), 1U);
  EXPECT_EQ(all.back().text,
            "Uniform: less quality than ours (0.3900), but within 5 %: always_sampled (0.3800).");
}

TEST(EvalFindings, JudgeByAgreementWhereItIsKnown) {
  Document document = erdos_document(
      {system_row("ours", 10, 0.002, 0.006, 0.8), system_row("always_10cm", 90, 0.02, 0.04, 0.7)});
  document.experiment = "table-lidar";
  auto& rows = std::get<std::vector<SystemRow>>(document.tables[0].rows);
  rows[0].agreement = {0.81, 0.80};
  rows[1].agreement = {0.95, 0.85};
  const auto all = findings(document);
  ASSERT_EQ(count(all, Finding::Kind::kMissed), 1U);
  EXPECT_EQ(all[0].text,
            "Uniform: with no less effective agreement than ours (0.8000): always_10cm (0.8500).");
  EXPECT_EQ(to_json(experiments::document_from(to_json(document))).dump(),
            to_json(document).dump());
}

// What was shown is clustered for real, and agrees as the profile says on average.
TEST(EvalScorer, ClustersWhatWasShown) {
  const fs::path data = places::source() + "/../shared/data";
  process::Progress quiet(true);
  const process::SignalWatch signals;
  using experiments::CloudScorer;
  const std::uint32_t rounds = 10;
  for (const auto sweep : {eval::LidarSweep::kKitti, eval::LidarSweep::kNuScenes}) {
    const CloudScorer scorer(data, sweep, rounds, quiet);
    if (!scorer.missing().empty()) GTEST_SKIP() << scorer.missing();
    const eval::Profile profile = eval::lidar_profile(sweep);
    const auto score = [&](const eval::Shown& shown) {
      std::vector<ShownRound> all;
      for (std::uint32_t i = 0; i < rounds; ++i) all.push_back({i, shown});
      return scorer.agreement(all).value();
    };
    using Kind = eval::Shown::Kind;
    EXPECT_DOUBLE_EQ(score({Kind::kRemote, 2, 0, 0}), 1);
    EXPECT_DOUBLE_EQ(score({}), 0);
    for (const eval::Shown shown : {eval::Shown{Kind::kLocal, 0, 0, 0},
                                    {Kind::kRemote, 1, 2, 0},
                                    {Kind::kRemote, 2, 1, 0},
                                    {Kind::kRemote, 0, 3, 0}}) {
      EXPECT_NEAR(score(shown), quality_of(profile, shown), 0.05);
    }
    const ShownRound old{1, {Kind::kStale, 2, 0, 1}};
    EXPECT_LT(scorer.agreement({&old, 1}).value(), 0.2);
    EXPECT_EQ(scorer.agreement({}), std::nullopt);
  }
  EXPECT_FALSE(
      CloudScorer(std::nullopt, eval::LidarSweep::kKitti, rounds, quiet).missing().empty());
}

TEST(EvalScorer, ScoresWhatWasShown) {
  const fs::path data = places::source() + "/../shared/data";
  if (!fs::is_directory(data / "detections") || !fs::is_regular_file(data / "pets/gt.txt")) {
    GTEST_SKIP() << "no recorded detections or ground truth";
  }
  const Scorer scorer(data, true);
  // The figures of docs/constants.md, "Images and detectors".
  EXPECT_NEAR(scorer.score(2, false)->ap, 0.396, 0.002);
  EXPECT_NEAR(scorer.score(0, true)->ap, 0.128, 0.002);
  std::vector<ShownRound> one_old;
  for (std::uint32_t i = 1; i < kVideoFrames; ++i) {
    one_old.push_back({i, {eval::Shown::Kind::kStale, 2, 0, 1}});
  }
  EXPECT_NEAR(scorer.score(one_old)->ap, 0.250, 0.003);
  EXPECT_EQ(Scorer(std::nullopt, false).score(one_old), std::nullopt);
  // Nothing, remote, local and stale in turn; AP and AR by the scorer that comes with the data.
  using Kind = eval::Shown::Kind;
  constexpr eval::Shown kInTurn[] = {{Kind::kNothing, 0, 0, 0},
                                     {Kind::kRemote, 2, 1, 0},
                                     {Kind::kLocal, 0, 0, 0},
                                     {Kind::kStale, 1, 0, 2}};
  std::vector<ShownRound> mixed;
  for (std::uint32_t i = 0; i < kVideoFrames; ++i) mixed.push_back({i, kInTurn[i % 4]});
  EXPECT_NEAR(scorer.score(mixed)->ap, 0.149594, 1e-6);
  EXPECT_NEAR(scorer.score(mixed)->ar, 0.241600, 1e-6);
}

}  // namespace
}  // namespace interneuron::cli::eval_test
