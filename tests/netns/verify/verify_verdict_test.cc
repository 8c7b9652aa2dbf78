// The verdicts of `testbed verify` on made-up links: what is right passes, what is wrong is seen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "netns/verify/assess.h"
#include "verify_support.h"

namespace interneuron::netns::verify::verify_verdict_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

struct Truth {
  double rtt_ms = 40;
  double loss = 0.01;
  double mbit = 10;
};

// A link that does what `truth` says: 30 s, 2000 packets a second, 100 pings.
LinkEvidence evidence(const Truth& truth, const Schedule& schedule) {
  std::mt19937_64 rng(kSeed);
  std::uniform_real_distribution<double> uniform;
  LinkEvidence e;
  e.schedule = schedule;
  e.from = seconds(2);
  e.to = seconds(32);
  for (std::uint32_t i = 0; i < 3000; ++i) {
    e.pings.answered.push_back({i, e.from + i * milliseconds(10), from_ms(truth.rtt_ms + 0.1)});
  }
  for (DirectionEvidence& d : e.directions) {
    for (int i = 0; i < 60'000; ++i) {
      Flow::Packet packet{e.from + i * microseconds(500), 128, std::nullopt};
      if (uniform(rng) >= truth.loss) {
        packet.arrived = packet.sent + from_ms(truth.rtt_ms / 2 + 0.12);
      } else {
        ++d.counted.lost;
      }
      ++d.counted.packets_in;
      d.flow.packets.push_back(packet);
    }
    d.rate.schedule = schedule;
    const double offered_us = 1428 * 8 / truth.mbit / 1.15;
    for (std::uint32_t i = 0; 1428 * 8e-6 / truth.mbit * i < 4; ++i) {
      const Duration seen = seconds(1) + from_ms(1428 * 8e-3 / truth.mbit * i);
      Datagram got = datagram(1 + i, seen, from_ms(offered_us * i / 1e3));
      got.ip_bytes = 1428;
      if (uniform(rng) >= truth.loss) d.rate.received.push_back(got);
    }
  }
  return e;
}

Verdict verdict_of(const std::vector<Figure>& figures, const std::string& name) {
  for (const Figure& figure : figures) {
    if (figure.name == name) return figure.verdict;
  }
  ADD_FAILURE() << "no figure " << name;
  return Verdict::kNotMeasured;
}

TEST(VerifyVerdict, AGoodLinkPasses) {
  const auto figures = assess(evidence({}, constant(40, 0.01)));
  for (const Figure& figure : figures) {
    EXPECT_EQ(figure.verdict, Verdict::kOk) << figure.name << ' ' << figure.difference.value_or(0);
  }
  EXPECT_EQ(overall({figures}), Verdict::kOk);
  EXPECT_EQ(figures.size(), 2U + 2 * 7);
}

TEST(VerifyVerdict, AWrongDelayIsSeen) {
  const auto figures = assess(evidence({41, 0.01, 10}, constant(40, 0.01)));
  EXPECT_EQ(verdict_of(figures, "round trip mean"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(figures, "up delay mean"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(figures, "down delay mean"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(figures, "round trip error p99"), Verdict::kOk);
  EXPECT_EQ(verdict_of(figures, "up loss"), Verdict::kOk);
  EXPECT_EQ(overall({figures}), Verdict::kFailed);
  EXPECT_EQ(
      verdict_of(assess(evidence({43, 0.01, 10}, constant(40, 0.01))), "round trip error p99"),
      Verdict::kFailed);
}

TEST(VerifyVerdict, AWrongLossIsSeen) {
  const auto figures = assess(evidence({40, 0.015, 10}, constant(40, 0.01)));
  EXPECT_EQ(verdict_of(figures, "up loss"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(figures, "down loss"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(figures, "up loss, own count"), Verdict::kOk);
  EXPECT_EQ(verdict_of(figures, "up delay mean"), Verdict::kOk);
}

TEST(VerifyVerdict, AWrongRateIsSeen) {
  const auto figures = assess(evidence({40, 0, 9.6}, constant(40, 0, 10)));
  EXPECT_EQ(verdict_of(figures, "up rate"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(assess(evidence({40, 0, 9.8}, constant(40, 0, 10))), "up rate"),
            Verdict::kOk);
}

TEST(VerifyVerdict, ARateThatWasNotOfferedIsInconclusive) {
  const auto figures = assess(evidence({40, 0, 5}, constant(40, 0, 10)));
  EXPECT_EQ(verdict_of(figures, "up rate"), Verdict::kInconclusive);
}

TEST(VerifyVerdict, AChangeOfDelayIsNoChangeOfRate) {
  // 1 s more of delay, within 2.5 s: a naive receiver would see 8.5 instead of 10 Mbit/s.
  const Schedule s = made(
      seconds(40),
      [](std::int64_t step) {
        return 40.0 + 4.0 * static_cast<double>(std::min(step, std::int64_t{250}));
      },
      0, 10);
  RateRun run;
  run.schedule = s;
  for (std::uint32_t i = 0; i < 3000; ++i) {
    const Duration left = from_ms(1428 * 8e-4 * i);
    run.received.push_back(datagram(1 + i, left + s.one_way(left), from_ms(1428 * 6.9e-4 * i)));
    run.received.back().ip_bytes = 1428;
  }
  const Figure figure = judge_rate("up rate", run, Direction::kUp);
  EXPECT_EQ(figure.verdict, Verdict::kOk) << *figure.difference;
  EXPECT_NEAR(*figure.difference, 0, 0.3);
}

TEST(VerifyVerdict, OrderAndDuplicates) {
  LinkEvidence e = evidence({}, constant(40, 0.01));
  e.directions[0].flow.reordered = 1;
  e.directions[1].flow.duplicates = 1;
  EXPECT_EQ(verdict_of(assess(e), "up reordered"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(assess(e), "down duplicates"), Verdict::kFailed);
  e.directions[1].asked.duplicate = true;
  EXPECT_EQ(verdict_of(assess(e), "down duplicates"), Verdict::kNotMeasured);
}

TEST(VerifyVerdict, TooFewPacketsOfBurstsDecideNothing) {
  LinkEvidence e = evidence({40, 0.0135, 10}, constant(40, 0.01));
  EXPECT_EQ(verdict_of(assess(e), "up loss"), Verdict::kFailed);
  e.directions[0].asked.gilbert_elliott = emu::GilbertElliott{0.001, 0.099, 0, 1};
  EXPECT_EQ(verdict_of(assess(e), "up loss"), Verdict::kInconclusive);
}

TEST(VerifyVerdict, OnlyANamedCauseExcuses) {
  LinkEvidence e = evidence({41, 0.01, 10}, constant(40, 0.01));
  e.disturbance.late_mean_ms = 0.1;
  EXPECT_EQ(verdict_of(assess(e), "round trip mean"), Verdict::kFailed);
  e.disturbance.late_mean_ms = 0.5;
  EXPECT_EQ(verdict_of(assess(e), "round trip mean"), Verdict::kInconclusive);
  e.capture_drops = 3;
  EXPECT_EQ(verdict_of(assess(e), "up reordered"), Verdict::kInconclusive);
  // Too early is never the emulator's lateness.
  e = evidence({39, 0.01, 10}, constant(40, 0.01));
  e.disturbance.late_mean_ms = 0.5;
  EXPECT_EQ(verdict_of(assess(e), "round trip mean"), Verdict::kFailed);
}

TEST(VerifyVerdict, ADeadLinkFailsUnlessItIsAnOutage) {
  LinkEvidence e = evidence({}, constant(40, 0.01));
  e.pings.answered.clear();
  for (DirectionEvidence& d : e.directions) d.flow = {};
  EXPECT_EQ(verdict_of(assess(e), "round trip"), Verdict::kFailed);
  EXPECT_EQ(verdict_of(assess(e), "up delay"), Verdict::kFailed);
  e.schedule = constant(40, 1);
  EXPECT_EQ(verdict_of(assess(e), "round trip"), Verdict::kNotMeasured);
  EXPECT_EQ(verdict_of(assess(e), "down delay"), Verdict::kNotMeasured);
}

TEST(VerifyVerdict, FewBurstsAreShownOnly) {
  LinkEvidence e = evidence({}, constant(40, 0.01));
  e.directions[0].asked.gilbert_elliott = emu::GilbertElliott{0.005, 0.2, 0, 1};
  EXPECT_EQ(verdict_of(assess(e), "up burst length"), Verdict::kNotMeasured);
  e = evidence({40, 0.05, 10}, constant(40, 0.05));
  e.directions[0].asked.gilbert_elliott = emu::GilbertElliott{0.0105, 0.2, 0, 1};
  EXPECT_EQ(verdict_of(assess(e), "up burst length"), Verdict::kFailed);  // single losses
}

TEST(VerifyFindings, TableAndJsonAgree) {
  Findings findings{"t", 5, "emulator", {0.02, 0.5, 0}, {}};
  findings.links.push_back(summarise("5g", "5g", evidence({41, 0.01, 10}, constant(40, 0.01))));
  const auto json = nlohmann::json::parse(to_json(findings));
  EXPECT_EQ(json.at("schema"), "interneuron.verify/1");
  EXPECT_EQ(json.at("verdict"), "failed");
  EXPECT_EQ(json.at("seed"), 5);
  EXPECT_EQ(json.at("links")[0].at("packets").at("up").at("sent"), 60'000);
  EXPECT_EQ(json.at("links")[0].at("figures").size(), findings.links[0].figures.size());
  const std::string table = to_table(findings);
  EXPECT_THAT(table, testing::HasSubstr("FAILED"));
  EXPECT_THAT(table, testing::EndsWith("verify: FAILED\n"));
}

}  // namespace
}  // namespace interneuron::netns::verify::verify_verdict_test
