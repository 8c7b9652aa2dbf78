// The figures of docs/computing.md, "Limits", are those of the code.
#include "tests/limits_page.h"

#include <gtest/gtest.h>

#include "app/computing/jobs.h"
#include "app/perception/codec.h"
#include "app/perception/jpeg.h"
#include "app/perception/motion.h"

namespace interneuron::perception::limits_page_test {
namespace {

using namespace limits_page;

TEST(LimitsPage, HasTheFiguresOfTheRoadsideUnit) {
  const std::string pixels = "1920 × 1080";
  static_assert(kMaxJpegPixels == 1920 * 1080);
  const JpegLimits jpeg;
  const auto decoding = std::chrono::duration_cast<std::chrono::milliseconds>(jpeg.time).count();
  const std::map<std::string, std::string> expected{
      {"UnitRules::waiting_per_peer", grouped(computing::UnitRules{}.waiting_per_peer)},
      {"computing::kLongestBelieved", seconds(computing::kLongestBelieved)},
      {"kMaxJpegBytes", figure(kMaxJpegBytes, 1'000'000, "MB")},
      {"JpegLimits::pixels", jpeg.pixels == kMaxJpegPixels ? pixels : "others"},
      {"JpegLimits::scans", std::to_string(jpeg.scans)},
      {"JpegLimits::time", std::to_string(decoding) + " ms"},
      {"MotionStreams::kMaxPerSender", grouped(MotionStreams::kMaxPerSender)},
      {"MotionStreams::kMaxStreams", grouped(MotionStreams::kMaxStreams)},
      {"MotionStreams::kLifetime", seconds(MotionStreams::kLifetime)}};
  auto figures = figures_of("/docs/computing.md", 3);
  // What is no constant: a rule, the guard's level, a list of kinds, a private constant.
  for (const char* rule : {"RoadsideUnit::next()", "ShareOfTime", "decode_jpeg()", "road.cc"}) {
    EXPECT_EQ(figures.erase(rule), 1U) << rule;
  }
  EXPECT_EQ(figures, expected);
}

}  // namespace
}  // namespace interneuron::perception::limits_page_test
