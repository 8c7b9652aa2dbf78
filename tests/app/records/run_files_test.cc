#include "app/records/run_files.h"

#include <fstream>

#include "app/process/failure.h"
#include "app/records/plot.h"
#include "app/records/staging.h"
#include "core/base/statistics.h"
#include "tests/app/cli/support.h"

namespace interneuron::records::run_files_test {
namespace {

using namespace std::chrono_literals;

std::vector<RoundRow> rows() {
  std::vector<RoundRow> out;
  for (std::uint32_t i = 0; i < 10; ++i) {
    RoundRow r;
    r.round = i;
    r.frame = static_cast<int>(i);
    r.t0 = TimePoint{i * 100ms};
    r.answered = true;
    r.outcome = i < 8 ? Outcome::kRemote : Outcome::kLocal;
    r.e2e = i < 8 ? 100ms + i * 1ms + 123456ns : 130ms;
    r.age_rounds = i == 9 ? std::optional<std::uint32_t>(1) : std::optional<std::uint32_t>(0);
    r.x_permille = -1000;
    if (i < 8)
      r.road = RoundRow::Road{
          i % 2 == 0 ? "raw" : "sampled", static_cast<int>(i % 3), true, false, 5ms, 40ms};
    r.plan = i == 9 ? kRefusedPlan : "raw:a sampled:b";
    r.guard = "budget";
    out.push_back(r);
  }
  return out;
}

RunInfo info() {
  RunInfo i;
  i.seeded = true;
  i.seed = 7;
  i.deadline = 130ms;
  i.period = 100ms;
  i.guard = "budget";
  i.links = {{"a", 1000, 10, 1, 2}, {"b", 2000, 20, 0, 0}};
  return i;
}

TEST(Percentile, IsTheNearestRank) {
  EXPECT_EQ(percentile({}, 0.5), 0);
  EXPECT_EQ(percentile({5}, 0.99), 5);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.5), 2);
  EXPECT_EQ(percentile({4, 1, 3, 2}, 0.95), 4);
}

TEST(Report, CountsAddUp) {
  const Json s = summarise(rows(), info());
  EXPECT_EQ(s["rounds"], 10);
  EXPECT_EQ(s["answers"], 10);
  EXPECT_EQ(s["on_time"], 8);
  EXPECT_EQ(s["local"], 2);
  EXPECT_EQ(s["timeouts"], 2);
  EXPECT_EQ(s["local_not_fresh"], 1);
  EXPECT_EQ(s["e2e_ms"]["p50"], 103.123);
  EXPECT_EQ(s["bytes"]["b"]["sent"], 2000);
  EXPECT_TRUE(s["ap"].is_null());
  EXPECT_EQ(s["used"]["local"], 2);
  EXPECT_EQ(s["refused"], 1);
  EXPECT_EQ(s["guard"], "budget");
}

TEST(Report, TheSummaryOfTheFileIsTheSummaryOfTheRun) {
  const cli::TempFolder folder;
  write_csv(folder / "rounds.csv", rows());
  const auto back = read_csv(folder / "rounds.csv");
  EXPECT_EQ(summarise(back, info()).dump(), summarise(rows(), info()).dump());
  EXPECT_EQ(back.front().guard, "budget");
}

TEST(Report, FiguresThatNoRoundHasAreRefused) {
  const cli::TempFolder folder;
  const std::string file = folder / "rounds.csv";
  write_csv(file, rows());
  std::ifstream in(file);
  std::string header;
  std::string row;
  ASSERT_TRUE(std::getline(in, header) && std::getline(in, row));
  // The fifth column is e2e_ms; a conversion of these would be undefined.
  std::size_t at = 0;
  for (int comma = 0; comma < 4; ++comma) at = row.find(',', at) + 1;
  for (const char* figure : {"1e300", "-1e300", "inf", "nan"}) {
    std::string bad = row;
    bad.replace(at, bad.find(',', at) - at, figure);
    std::ofstream(file) << header << '\n' << bad << '\n';
    EXPECT_THROW(read_csv(file), process::Failure) << bad;
  }
}

TEST(Report, DrawsThePlot) {
  const cli::TempFolder folder;
  const Json s = summarise(rows(), info());
  ASSERT_TRUE(plot_latency(folder / "latency.png", rows(), s));
  EXPECT_GT(std::filesystem::file_size(folder / "latency.png"), 5'000U);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.string()),
                          std::filesystem::directory_iterator()),
            1);  // no script left behind
}

TEST(Report, APlotBeginsWithTheFirstRowThatItIsGiven) {
  const cli::TempFolder folder;
  auto later = rows();
  for (RoundRow& row : later) row.round += 1'000'000;
  EXPECT_TRUE(plot_latency(folder / "latency.png", later, summarise(later, info())));
}

TEST(Tally, QuantilesAreExactUpToItsBoundAndCloseBeyond) {
  Sample sample;
  for (int i = 1; i <= 1000; ++i) sample.add(i);
  EXPECT_EQ(sample.json()["p95"], 950);
  EXPECT_EQ(sample.json()["mean"], 500.5);
  // Three times the bound, in an order that favours neither end.
  Sample large;
  constexpr int kMany = 3 * static_cast<int>(Sample::kMaxValues);
  for (int i = 0; i < kMany; ++i) large.add(static_cast<double>((i * 7919LL) % kMany) / kMany);
  EXPECT_EQ(large.kept(), Sample::kMaxValues);
  // Five deviations of a share of 0.5 among 100,000 that are drawn.
  EXPECT_NEAR(large.json()["p50"].get<double>(), 0.5, 0.008);
  EXPECT_NEAR(large.json()["p99"].get<double>(), 0.99, 0.008);
}

TEST(Tally, NamesBeyondItsBoundAreCountedTogether) {
  RunTally tally;
  for (int i = 0; i < 1000; ++i) {
    RoundRow row;
    row.plan = "raw:" + std::to_string(i);
    tally.add(row);
  }
  const Json s = tally.summary(info());
  EXPECT_EQ(s["plans"].size(), RunTally::kMaxKinds + 1);
  EXPECT_EQ(s["plans"]["others"], 1000 - RunTally::kMaxKinds);
}

TEST(Staging, WhatAKilledProgramHasLeftGoesAndThatOfALivingOneStays) {
  const cli::TempFolder folder;
  std::filesystem::create_directory(folder / ".partial-dead00");
  write_json(folder / ".partial-dead00/summary.json", {});
  const Staging living(folder.string());
  write_json(living / "summary.json", {});
  {
    const Staging other(folder.string());
    EXPECT_FALSE(std::filesystem::exists(folder / ".partial-dead00"));
  }
  EXPECT_TRUE(std::filesystem::exists(living / "summary.json"));
}

TEST(Gnuplot, TextIsOneStringWhateverItHolds) {
  EXPECT_EQ(gnuplot_text("5g"), "'5g'");
  EXPECT_EQ(gnuplot_text("it's\n`touch x`"), "'it\u2019s `touch x`'");
  const cli::TempFolder folder;
  const std::string text = "';!touch '" + (folder / "x").string() + "'\n!touch x\n`touch x`\\";
  EXPECT_TRUE(
      draw(folder / "p.svg", "set terminal svg\nset title " + gnuplot_text(text) + "\nplot x\n"));
  EXPECT_FALSE(std::filesystem::exists(folder / "x"));
}

TEST(Gnuplot, AScriptThatFailsNamesThePictureAndLeavesNone) {
  const cli::TempFolder folder;
  try {
    draw(folder / "p.svg", "set terminal svg\nplot nothing\n");
    ADD_FAILURE() << "no failure";
  } catch (const process::Failure& failure) {
    EXPECT_EQ(failure.code(), process::kFailed);
    EXPECT_NE(std::string(failure.what()).find("p.svg"), std::string::npos);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "p.svg"));
}

}  // namespace
}  // namespace interneuron::records::run_files_test
