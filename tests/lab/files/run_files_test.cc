#include "lab/files/run_files.h"

#include "core/base/statistics.h"
#include "tests/app/cli/support.h"

namespace interneuron::cli {
namespace {

using namespace std::chrono_literals;

std::vector<lab::RoundRow> rows() {
  std::vector<lab::RoundRow> out;
  for (std::uint32_t i = 0; i < 10; ++i) {
    lab::RoundRow r;
    r.round = i;
    r.frame = static_cast<int>(i);
    r.t0 = TimePoint{i * 100ms};
    r.answered = true;
    r.outcome = i < 8 ? Outcome::kRemote : Outcome::kLocal;
    r.e2e = i < 8 ? 100ms + i * 1ms + 123456ns : 130ms;
    r.age_rounds = i == 9 ? std::optional<std::uint32_t>(1) : std::optional<std::uint32_t>(0);
    r.x_permille = -1000;
    if (i < 8)
      r.road =
          lab::RoundRow::Road{i % 2 == 0 ? 0 : 1, static_cast<int>(i % 3), true, false, 5ms, 40ms};
    r.plan = i == 9 ? lab::kRefusedPlan : "raw:a sampled:b";
    r.guard = "budget";
    out.push_back(r);
  }
  return out;
}

lab::RunInfo info() {
  lab::RunInfo i;
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
  const lab::Json s = lab::summarise(rows(), info());
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
  const TempFolder folder;
  lab::write_csv(folder / "rounds.csv", rows());
  const auto back = lab::read_csv(folder / "rounds.csv");
  EXPECT_EQ(lab::summarise(back, info()).dump(), lab::summarise(rows(), info()).dump());
  EXPECT_EQ(back.front().guard, "budget");
}

TEST(Report, DrawsThePlot) {
  const TempFolder folder;
  const lab::Json s = lab::summarise(rows(), info());
  ASSERT_TRUE(lab::plot_latency(folder / "latency.png", rows(), s));
  EXPECT_GT(std::filesystem::file_size(folder / "latency.png"), 5'000U);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.string()),
                          std::filesystem::directory_iterator()),
            1);  // no script left behind
}

}  // namespace
}  // namespace interneuron::cli
