// What symbols, shares and shadows are for: losses that leave no time to ask again, messages that
// one link does not bring in time, and links that fall silent. Short forms of longer series, with
// the share that may be missed in the long run and room for chance: four standard deviations of a
// binomial count.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "lab/coding/drives.h"
#include "lab/coding/series.h"
#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::coding_test {
namespace {

constexpr std::size_t kImage = 128 * 1024;

// What may be missed of a series in the long run, and its bytes on the wire for each byte.
struct Point {
  const char* series;
  double missed;
  double ratio;
};

class Coding : public testing::TestWithParam<Point> {};

TEST_P(Coding, FewAreMissedForFewBytes) {
  const Point& point = GetParam();
  const coding::Series& series = *coding::series_of(point.series);
  const coding::Row row = coding::run(series, series.policy, kSanitized ? 100 : 600, 17);
  const double expected = point.missed * static_cast<double>(row.messages);
  std::printf("%s: %zu of %zu missed, wire ratio %.3f\n", point.series, row.missed, row.messages,
              row.wire_ratio);
  EXPECT_LE(static_cast<double>(row.missed), expected + 4 * std::sqrt(expected));
  EXPECT_LE(row.wire_ratio, point.ratio);
}

INSTANTIATE_TEST_SUITE_P(Series, Coding,
                         testing::Values(Point{"losses", 0.001, 1.16}, Point{"bursts", 0.015, 1.25},
                                         Point{"eights", 0.005, 1.2}, Point{"near", 0.0002, 1.12},
                                         Point{"clean", 0, 1.1}, Point{"halves", 0, 1.1}),
                         [](const auto& p) { return std::string(p.param.series); });

// The first link is dark for five seconds, from any instant of a message's time on.
TEST(Coding, AHoleCostsQualityOfTwoMessagesAtMost) {
  coding::Series hole = *coding::series_of("hole");
  hole.phases = kSanitized ? 2 : 10;
  for (const char* policy : {"shadow", "stripe", "coded"}) {
    const coding::Row row = coding::run(hole, policy, 80, 3);
    EXPECT_LE(row.missed, 1U) << policy;
    EXPECT_LE(row.most_degraded, 2U) << policy;
    EXPECT_LE(row.wire_ratio, 1.15) << policy;
  }
}

// Each modem alone misses a tenth of the messages and more; what one of them cannot bring, both
// together mostly can.
TEST(Coding, SharesMakeTwoModemsWhoseRatesChangeOneThatHolds) {
  const std::vector<std::string> policies{"stripe"};
  std::size_t missed = 0;
  std::size_t alone = 0;
  std::size_t clairvoyant = 0;
  for (std::uint64_t seed = 900; seed < (kSanitized ? 901 : 904); ++seed) {
    const coding::DriveRow row =
        coding::run_drive(coding::generated_drive(seed), policies, kSanitized ? 60 : 400, seed);
    missed += row.policies.front().missed;
    alone += row.best_alone();
    clairvoyant += row.clairvoyant;
    EXPECT_LE(row.clairvoyant, row.best_alone()) << row.drive;
    EXPECT_LE(row.policies.front().wire_ratio, 1.25) << row.drive;
  }
  std::printf("%zu missed, %zu by the better modem alone, %zu by a clairvoyant\n", missed, alone,
              clairvoyant);
  EXPECT_LE(missed, 3 * clairvoyant + alone / 10 + 2);
}

TEST(Coding, ARotatedTraceHasTheSameOpportunities) {
  const emu::Opportunities trace{{1, 4, 4, 10}};
  EXPECT_EQ(coding::rotated(trace, 0).at_ms, trace.at_ms);
  EXPECT_EQ(coding::rotated(trace, 4).at_ms, (std::vector<std::int64_t>{6, 7, 10, 10}));
  EXPECT_EQ(coding::rotated(trace, 14).at_ms, (std::vector<std::int64_t>{6, 7, 10, 10}));
}

// Two modems with one opportunity each, at 30 and at 70 ms of 100, whenever the drive begins.
TEST(Coding, APairBeginsAtOneInstantOfBothTraces) {
  std::vector<coding::Modem> modems;
  for (const std::int64_t at : {30, 70}) {
    const auto trace = std::make_shared<emu::Opportunities>(emu::Opportunities{{at, 100}});
    modems.push_back({"m", trace, trace, std::chrono::milliseconds(20)});
  }
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    const coding::Drive drive = coding::paired_drive(modems, seed);
    std::vector<std::int64_t> apart;
    for (const std::int64_t at : drive.modems[1].up->at_ms) {
      for (const std::int64_t other : drive.modems[0].up->at_ms) {
        apart.push_back((at - other + 100) % 100);
      }
    }
    EXPECT_TRUE(std::ranges::find(apart, 40) != apart.end()) << seed;
    EXPECT_EQ(drive.modems[0].up->at_ms, drive.modems[0].down->at_ms) << seed;
  }
}

// Repairs of what symbols stand for would be bytes for nothing. Now and then the symbols come too
// late, and all of a message is sent again, so that one beginning alone says little.
TEST(Coding, AMessageThatIsDecodedAsksForNothing) {
  std::uint64_t symbols = 0;
  std::uint64_t resent = 0;
  std::uint64_t lost = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Duo s({constant_link("a", 78, 60, 60, 0.01), constant_link("b", 78, 20, 20, 0.01)},
          {.policy = "coded", .variants = {kImage}, .deadline = 130ms, .seed = seed});
    s.send(2s, 100);
    s.run();
    EXPECT_EQ(s.missed(), 0U) << seed;
    for (const LinkId link : {LinkId{0}, LinkId{1}}) {
      const LinkCounters c = s.world.endpoint(s.vehicle).link_counters(link);
      symbols += c.symbols_sent;
      resent += c.fragments_resent;
      lost += c.fragments_lost;
    }
  }
  EXPECT_GT(symbols, 10 * 400U);
  // What was made good by symbols is lost all the same, for the control of congestion.
  EXPECT_GT(lost, 10 * 60U);
  EXPECT_LT(resent, lost / 2) << lost << " lost";
}

// Users of bonded links ask most for this: a second modem must not make it worse.
TEST(Coding, ASlowLinkMoreNeverRaisesMisses) {
  for (const char* policy : {"stripe", "coded"}) {
    for (const double slow : {2.0, 8.0, 20.0}) {
      for (const double loss : {0.0, 0.01}) {
        const auto missed = [&](bool both) {
          std::vector links{constant_link("a", 40, 40, 40, loss)};
          if (both) links.push_back(constant_link("b", 160, slow, slow, loss));
          Duo s(links, {.policy = policy, .variants = {kImage}, .deadline = 120ms, .seed = 23});
          s.send(2s, kSanitized ? 30 : 150);
          s.run();
          return s.missed();
        };
        EXPECT_LE(missed(true), missed(false) + (loss > 0 ? 1 : 0))
            << policy << ", " << slow << " Mbit/s, loss " << loss;
      }
    }
  }
}

struct TwoLinks {
  double fast, fast_rtt, slow, slow_rtt;
  std::size_t bytes;
  Duration deadline;
};

// How many of 450 messages are missed over the fast link, or both.
std::size_t missed_over(const TwoLinks& c, const char* policy, bool both) {
  std::size_t missed = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    std::vector links{constant_link("a", c.fast_rtt, c.fast, c.fast, 0.01)};
    if (both) links.push_back(constant_link("b", c.slow_rtt, c.slow, c.slow, 0.01));
    Duo s(links, {.policy = policy, .variants = {c.bytes}, .deadline = c.deadline, .seed = seed});
    s.send(2s, kSanitized ? 30 : 150);
    s.run();
    missed += s.missed();
  }
  return missed;
}

// Losses of the last packets make a link look silent, messages are under way when the next ones are
// queued, and what is sent again may have less time than a slow link takes for it.
TEST(Coding, ASlowLinkIsNoReasonToLeaveTheFastOne) {
  for (const TwoLinks& c :
       {TwoLinks{54, 25, 1.3, 66, 400'887, 156ms}, TwoLinks{30, 70, 2.3, 32, 227'749, 161ms},
        TwoLinks{61, 28, 10.6, 213, 289'280, 108ms}}) {
    for (const char* policy : {"stripe", "coded"}) {
      for (const bool both : {false, true}) {
        EXPECT_LE(missed_over(c, policy, both), 2U)
            << policy << ", " << c.fast << " Mbit/s, both " << both;
      }
    }
  }
}

}  // namespace
}  // namespace interneuron::sim::coding_test
