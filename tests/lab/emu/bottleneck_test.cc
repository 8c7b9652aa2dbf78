#include "lab/emu/bottleneck.h"

#include <gtest/gtest.h>

namespace interneuron::emu::bottleneck_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

RateTrace stepped(std::vector<RateStep> steps, Duration period = {}) {
  return std::make_shared<const SteppedRate>(SteppedRate{std::move(steps), period});
}

RateTrace opportunities(std::vector<std::int64_t> at_ms) {
  return std::make_shared<const Opportunities>(Opportunities{std::move(at_ms)});
}

Duration send(Bottleneck& bottleneck, Duration now, std::size_t bytes) {
  const Duration left = bottleneck.departure(now, bytes);
  bottleneck.send();
  return left;
}

// Offers packets of 1200 bytes without pause for `time` and returns what leaves, in bit/s.
double throughput(Bottleneck bottleneck, Duration time) {
  constexpr std::size_t kBytes = 1200;
  double bits = 0;
  while (send(bottleneck, {}, kBytes) <= time) bits += kBytes * 8;
  return bits * 1e9 / static_cast<double>(time.count());
}

TEST(Bottleneck, AskingSendsNothing) {
  Bottleneck bottleneck(DataRate::mbit(8));
  EXPECT_EQ(bottleneck.departure({}, 1000), milliseconds(1));
  EXPECT_EQ(bottleneck.departure({}, 1000), milliseconds(1));
  bottleneck.send();
  EXPECT_EQ(bottleneck.departure({}, 1000), milliseconds(2));
}

TEST(Bottleneck, RatesAreWithinThreePercent) {
  EXPECT_NEAR(throughput(Bottleneck(DataRate::mbit(20)), seconds(60)), 20e6, 0.03 * 20e6);

  const RateTrace steps = stepped(
      {{{}, DataRate::mbit(30)}, {seconds(2), DataRate::mbit(6)}, {seconds(3), {}}}, seconds(4));
  EXPECT_NEAR(throughput(Bottleneck(steps), seconds(60)), 16.5e6, 0.03 * 16.5e6);
  EXPECT_EQ(mean_rate(*std::get<0>(steps)), DataRate::mbit(16.5));

  // 5 opportunities in 6 ms: 10 Mbit/s.
  const RateTrace trace = opportunities({1, 2, 2, 4, 6});
  EXPECT_NEAR(throughput(Bottleneck(trace), seconds(60)), 10e6, 0.03 * 10e6);
  EXPECT_EQ(mean_rate(*std::get<1>(trace)), DataRate::mbit(10));
}

TEST(Bottleneck, StepsChangeTheRateWithinAPacket) {
  Bottleneck bottleneck(stepped({{{}, DataRate::mbit(8)}, {milliseconds(10), DataRate::mbit(80)}}));
  // Half of it at 1 byte per us, half at 10.
  EXPECT_EQ(send(bottleneck, milliseconds(9), 2000),
            milliseconds(10) + std::chrono::microseconds(100));
  EXPECT_EQ(bottleneck.mean(milliseconds(0), milliseconds(20)), DataRate::mbit(44));
  EXPECT_EQ(bottleneck.mean(seconds(100), milliseconds(20)), DataRate::mbit(80));
}

TEST(Bottleneck, StandsWhileTheRateIsZero) {
  const RateTrace off = stepped({{{}, DataRate::mbit(8)}, {seconds(1), {}}}, seconds(3));
  Bottleneck repeating(off);
  EXPECT_EQ(send(repeating, milliseconds(1500), 1000), milliseconds(3001));
  Bottleneck for_ever(stepped({{{}, DataRate::mbit(8)}, {seconds(1), {}}}));
  EXPECT_EQ(for_ever.departure(seconds(2), 1000), Duration::max());
  EXPECT_EQ(for_ever.mean(seconds(2), milliseconds(20)), DataRate{});
}

TEST(Bottleneck, PacketsShareAnOpportunity) {
  Bottleneck bottleneck(opportunities({5, 10, 10, 20}));
  EXPECT_EQ(send(bottleneck, {}, 500), milliseconds(5));
  EXPECT_EQ(send(bottleneck, milliseconds(1), 1000), milliseconds(5));
  EXPECT_EQ(send(bottleneck, milliseconds(1), 1500), milliseconds(10));
  EXPECT_EQ(send(bottleneck, milliseconds(1), 1600), milliseconds(20));  // takes two
  EXPECT_EQ(send(bottleneck, milliseconds(1), 1400), milliseconds(20));
  EXPECT_EQ(send(bottleneck, milliseconds(1), 1), milliseconds(25));
}

TEST(Bottleneck, OpportunitiesThatNobodyWaitsForAreWasted) {
  Bottleneck bottleneck(opportunities({5, 10, 10, 20}));
  EXPECT_EQ(send(bottleneck, milliseconds(6), 1500), milliseconds(10));
  EXPECT_EQ(send(bottleneck, milliseconds(11), 100), milliseconds(20));
  EXPECT_EQ(send(bottleneck, milliseconds(21), 100), milliseconds(25));  // the rest of 20 is gone
}

TEST(Bottleneck, OpportunitiesRepeatFromTheLastLine) {
  Bottleneck bottleneck(opportunities({0, 5, 20}));
  EXPECT_EQ(send(bottleneck, seconds(1), 1500), seconds(1));  // the end of lap 49,
  EXPECT_EQ(send(bottleneck, seconds(1), 1500), seconds(1));  // the 0 of lap 50
  EXPECT_EQ(send(bottleneck, seconds(1), 1500), seconds(1) + milliseconds(5));
  EXPECT_EQ(bottleneck.mean(seconds(2), milliseconds(20)), DataRate{3 * 1500 * 8 * 50});
}

TEST(Bottleneck, ATraceMayBeginLater) {
  Bottleneck bottleneck(opportunities({5, 20}), seconds(1));
  EXPECT_EQ(send(bottleneck, {}, 1500), seconds(1) + milliseconds(5));
  EXPECT_EQ(send(bottleneck, seconds(2), 1500), seconds(2));
}

std::string error_of(std::string_view text) {
  const auto result = parse_opportunities(text);
  const auto* error = std::get_if<std::string>(&result);
  return error == nullptr ? "no error" : *error;
}

TEST(Opportunities, ReadsMahimahisFormat) {
  const auto result = parse_opportunities("# ours\n0\n3\n\n3\r\n12\n");
  EXPECT_EQ(std::get<Opportunities>(result).at_ms, (std::vector<std::int64_t>{0, 3, 3, 12}));
}

TEST(Opportunities, ErrorsNameTheLine) {
  EXPECT_EQ(error_of("1\n2.5\n"), "line 2: '2.5' must be a whole number of ms");
  EXPECT_EQ(error_of("1\n-2\n"), "line 2: '-2' must be a whole number of ms");
  EXPECT_EQ(error_of("5\n4\n"), "line 2: 4 ms is before the line above");
  EXPECT_EQ(error_of("5\n4"), "line 2: the file is cut off: its last line has no end");
  EXPECT_EQ(error_of(""), "holds no opportunities after 0 ms; write one per line, in ms");
  EXPECT_EQ(error_of("0\n"), "holds no opportunities after 0 ms; write one per line, in ms");
}

}  // namespace
}  // namespace interneuron::emu::bottleneck_test
