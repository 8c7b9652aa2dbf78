// `interneuron bench forecast`: its JSON, its tables and its picture.
#include <filesystem>

#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"

namespace interneuron::cli::bench_forecast_test {
namespace {

TEST(BenchForecast, WritesBinsOfItsSchema) {
  const Ran ran = run("bench forecast dip --seed 3 --json", false);
  ASSERT_EQ(ran.code, 0) << ran.output;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  ASSERT_FALSE(document.is_discarded()) << ran.output.substr(0, 200);
  for (const auto& violation : watch::violations(watch::schema_of("forecast.json"), document)) {
    ADD_FAILURE() << violation;
  }
  EXPECT_EQ(document["first_seed"], 3);
  EXPECT_GE(document["rows"].size(), 2U);
  EXPECT_EQ(document["scores"].back()["scenario"], "dip");
}

TEST(BenchForecast, ShowsATableAndDrawsAPicture) {
  const TempFolder folder;
  const std::string file = (folder / "forecast.svg").string();
  EXPECT_THAT(run("bench forecast 5g --plot '" + file + "'"), EndsSaying(0, "all drives"));
  EXPECT_GT(std::filesystem::file_size(file), 1000U);
}

}  // namespace
}  // namespace interneuron::cli::bench_forecast_test
