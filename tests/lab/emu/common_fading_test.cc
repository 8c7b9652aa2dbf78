#include "lab/emu/delay_process.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "support.h"

namespace interneuron::emu::common_fading_test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

using Processes = std::vector<std::shared_ptr<DelayProcess>>;

Processes drive(double c, std::uint64_t seed) {
  Processes out{std::make_shared<DelayProcess>(profile_of("4g").delay, link_seed(seed, 0)),
                std::make_shared<DelayProcess>(profile_of("5g").delay, link_seed(seed, 1)),
                std::make_shared<DelayProcess>(profile_of("4g").delay, link_seed(seed, 2))};
  couple(out, c, seed);
  return out;
}

// Share of the EDGE entries of the first at which the second, STABLE just before, enters EDGE too.
double shared_entries(double c) {
  std::array<RadioState, 2> before{};
  int entries = 0;
  int shared = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Processes links = drive(c, seed);
    before = {};
    for (Duration t{}; t < seconds(2000); t += kDelayStep) {
      const std::array now{links[0]->at(t).state, links[1]->at(t).state};
      const bool entered = before[0] == RadioState::kStable && now[0] == RadioState::kEdge;
      if (entered && before[1] == RadioState::kStable) {
        ++entries;
        if (now[1] == RadioState::kEdge) ++shared;
      }
      before = now;
    }
  }
  EXPECT_GT(entries, 200);
  return static_cast<double>(shared) / entries;
}

TEST(CommonFading, SharesTheEntriesIntoEdge) {
  EXPECT_LT(shared_entries(0), 0.02);
  EXPECT_NEAR(shared_entries(1), 1.0, 1e-9);
  // Entries of the first that the second had triggered count as shared, so the share is above c.
  const double half = shared_entries(0.5);
  EXPECT_GT(half, 0.5);
  EXPECT_LT(half, 0.9);
}

TEST(CommonFading, WithoutItNothingChanges) {
  const Processes links = drive(0, 5);
  DelayProcess alone(profile_of("5g").delay, link_seed(5, 1));
  for (Duration t{}; t < seconds(300); t += kDelayStep) {
    ASSERT_EQ(links[1]->at(t).rtt, alone.at(t).rtt);
  }
}

RC_GTEST_PROP(CommonFading, DoesNotDependOnWhoIsReadFirst, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const Processes regular = drive(0.5, seed);
  std::array<std::vector<Duration>, 3> truth;
  for (Duration t{}; t < seconds(60); t += kDelayStep) {
    for (std::size_t i = 0; i < 3; ++i) truth[i].push_back(regular[i]->at(t).rtt);
  }
  const Processes jumpy = drive(0.5, seed);
  std::size_t newest = 0;
  const auto reads = *rc::gen::container<std::vector<std::pair<std::size_t, std::size_t>>>(
      rc::gen::pair(rc::gen::inRange<std::size_t>(0, 3), rc::gen::inRange<std::size_t>(0, 6000)));
  for (const auto& [link, index] : reads) {
    newest = std::max(newest, index);
    if (newest - index > 900) continue;  // beyond its memory
    RC_ASSERT(jumpy[link]->at(kDelayStep * static_cast<std::int64_t>(index)).rtt ==
              truth[link][index]);
  }
}

TEST(CommonFading, SurvivesTheEndOfALink) {
  Processes links = drive(1, 3);
  links[0]->at(seconds(100));
  links.erase(links.begin());
  links[0]->at(seconds(200));
  EXPECT_GT(links[1]->at(seconds(300)).rtt, Duration{});
}

TEST(CommonFading, LeavesMeasuredDrivesAlone) {
  const DelayParams trace = profile_of("lte-verizon-highway").delay;
  const Processes links{std::make_shared<DelayProcess>(trace, 1),
                        std::make_shared<DelayProcess>(profile_of("5g").delay, 2)};
  couple(links, 1, 3);
  DelayProcess alone(trace, 1);
  for (Duration t{}; t < seconds(300); t += milliseconds(100)) {
    links[1]->at(t);
    ASSERT_EQ(links[0]->at(t).rtt, alone.at(t).rtt);
  }
}

}  // namespace
}  // namespace interneuron::emu::common_fading_test
