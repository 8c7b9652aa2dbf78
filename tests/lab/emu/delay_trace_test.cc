#include "lab/emu/delay_trace.h"

#include <gtest/gtest.h>

#include <set>

#include "lab/emu/delay_process.h"
#include "support.h"

namespace interneuron::emu::delay_trace_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

std::string error_of(std::string_view text) {
  const auto result = parse_delay_trace(text);
  const auto* error = std::get_if<std::string>(&result);
  return error == nullptr ? "no error" : *error;
}

DelayParams trace_of(std::vector<double> rtt_ms, bool random_start = false) {
  DelayParams params;
  DelayTrace trace;
  trace.rtt_ms = std::move(rtt_ms);
  params.trace = std::make_shared<const DelayTrace>(std::move(trace));
  params.random_start = random_start;
  return params;
}

TEST(DelayTrace, ReadsItsFormat) {
  const auto result =
      parse_delay_trace("# Source: here\n# step_s = 0.5\n10\n\n# a tunnel\n-1\n20.5\n");
  const auto* trace = std::get_if<DelayTrace>(&result);
  ASSERT_NE(trace, nullptr);
  EXPECT_EQ(trace->source, "here");
  EXPECT_EQ(trace->step, milliseconds(500));
  EXPECT_EQ(trace->rtt_ms, (std::vector<double>{10, -1, 20.5}));
}

TEST(DelayTrace, ErrorsNameTheLine) {
  const std::string head = "# Source: here\n# step_s = 1\n";
  EXPECT_EQ(error_of("10\n20\n"), "line 1: must be \"# Source: WHERE FROM\"");
  EXPECT_EQ(error_of("# Source: here\n10\n"),
            "line 2: must be \"# step_s = SECONDS\", 0.01 to 3600");
  EXPECT_EQ(error_of("# Source: here\n# step_s = 0\n10\n"),
            "line 2: must be \"# step_s = SECONDS\", 0.01 to 3600");
  EXPECT_EQ(error_of(head + "10\nfast\n"),
            "line 4: 'fast' must be a round-trip time of 0 to 60000 ms, or -1");
  EXPECT_EQ(error_of(head + "10\n-2\n"),
            "line 4: '-2' must be a round-trip time of 0 to 60000 ms, or -1");
  EXPECT_EQ(error_of(head + "10\n20"), "line 4: the file is cut off: its last line has no end");
  EXPECT_EQ(error_of(head + "10\n"), "holds no round-trip times; it needs at least two samples");
  EXPECT_EQ(error_of(head + "-1\n-1\n"),
            "holds no round-trip times; it needs at least two samples");
  EXPECT_EQ(error_of(""), "line 1: must be \"# Source: WHERE FROM\"");
}

TEST(DelayTrace, IsInterpolatedAndRepeats) {
  DelayProcess process(trace_of({10, 20, 40}), 1);
  EXPECT_EQ(process.at({}).rtt, milliseconds(10));
  EXPECT_EQ(process.at(milliseconds(500)).rtt, milliseconds(15));
  EXPECT_EQ(process.at(milliseconds(1500)).rtt, milliseconds(30));
  EXPECT_EQ(process.at(milliseconds(2500)).rtt, milliseconds(25));  // towards the first
  EXPECT_EQ(process.at(seconds(3)).rtt, milliseconds(10));
  EXPECT_EQ(process.at(milliseconds(300'500)).rtt, milliseconds(15));
}

TEST(DelayTrace, UnavailableIsAnOutageWithTheLastDelay) {
  DelayProcess process(trace_of({10, -1, -1, 40}), 1);
  EXPECT_FALSE(process.at(milliseconds(990)).out);
  EXPECT_EQ(process.at(milliseconds(990)).rtt, milliseconds(10));
  for (const int ms : {1000, 1500, 2990}) {
    EXPECT_TRUE(process.at(milliseconds(ms)).out) << ms;
    EXPECT_EQ(process.at(milliseconds(ms)).rtt, milliseconds(10)) << ms;
  }
  EXPECT_FALSE(process.at(seconds(3)).out);
  EXPECT_EQ(process.at(seconds(3)).rtt, milliseconds(40));
}

TEST(DelayTrace, StaysFirstInFirstOut) {
  DelayProcess process(trace_of({100, 4000, 50, 50, 50, 50, 50}), 1);
  Duration last = process.at({}).rtt;
  for (Duration t = kDelayStep; t < seconds(20); t += kDelayStep) {
    const Duration rtt = process.at(t).rtt;
    ASSERT_GE(rtt, last - kDelayStep);
    last = rtt;
  }
}

TEST(DelayTrace, StartsAtTheBeginningUnlessToldOtherwise) {
  const std::vector<double> ramp{10, 20, 30, 40, 50, 60, 70, 80};
  std::set<Duration> fixed;
  std::set<Duration> random;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    fixed.insert(DelayProcess(trace_of(ramp), seed).at({}).rtt);
    random.insert(DelayProcess(trace_of(ramp, true), seed).at({}).rtt);
  }
  EXPECT_EQ(fixed, std::set<Duration>{milliseconds(10)});
  EXPECT_GT(random.size(), 40U);
  EXPECT_EQ(DelayProcess(trace_of(ramp, true), 7).at(seconds(5)).rtt,
            DelayProcess(trace_of(ramp, true), 7).at(seconds(5)).rtt);
}

// The figures of the measurement's own summary: 5 % of Sprint's highway drive were bad or
// unavailable.
TEST(DelayTrace, MeasuredDrivesAreBuiltIn) {
  int drives = 0;
  for (const BuiltInTrace& built_in : built_in_traces()) {
    if (!built_in.name.ends_with(".rtt")) continue;
    ++drives;
    const auto result = parse_delay_trace(built_in.text);
    ASSERT_TRUE(std::holds_alternative<DelayTrace>(result)) << built_in.name;
    EXPECT_GT(std::get<DelayTrace>(result).length(), std::chrono::minutes(50)) << built_in.name;
  }
  EXPECT_EQ(drives, 4);
  const auto sprint = profile_of("lte-sprint-highway").delay.trace;
  ASSERT_NE(sprint, nullptr);
  const auto gone = std::count_if(sprint->rtt_ms.begin(), sprint->rtt_ms.end(),
                                  [](double rtt_ms) { return rtt_ms < 0; });
  EXPECT_NEAR(static_cast<double>(gone) / static_cast<double>(sprint->rtt_ms.size()), 0.027, 0.001);
}

}  // namespace
}  // namespace interneuron::emu::delay_trace_test
