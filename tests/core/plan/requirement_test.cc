#include "interneuron/requirement.h"

#include <gmock/gmock.h>

#include "interneuron/policy.h"
#include "interneuron/sizes.h"

namespace interneuron::requirement_test {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

LinkState up(std::uint8_t id) { return LinkState{.id = LinkId{id}, .up = true}; }

std::vector<int> ids(std::span<const LinkState> links) {
  std::vector<int> out;
  for (const LinkState& link : links) out.push_back(link.id.value);
  return out;
}

TEST(Match, TakesEveryLinkThatIsUpWhenNothingIsRequired) {
  std::vector<LinkState> links{up(3), up(1), up(2)};
  links[1].up = false;
  EXPECT_THAT(ids(match({}, links)), ElementsAre(3, 2));
  EXPECT_THAT(match({}, {}), IsEmpty());
}

TEST(Match, DropsWhatIsMeasuredToBeUnderAFloor) {
  std::vector<LinkState> links{up(1), up(2)};
  links[0].rtt_p95 = milliseconds(20);
  links[1].rtt_p95 = milliseconds(21);
  links[0].rate = DataRate::mbit(10);
  links[1].rate = DataRate::mbit(11);
  links[0].loss = 0.01;
  links[1].loss = 0.02;
  links[1].nature.security = 0.5;
  EXPECT_THAT(ids(match({.max_rtt = milliseconds(20)}, links)), ElementsAre(1));
  EXPECT_THAT(ids(match({.min_rate = DataRate::mbit(11)}, links)), ElementsAre(2));
  EXPECT_THAT(ids(match({.max_loss = 0.01}, links)), ElementsAre(1));
  EXPECT_THAT(ids(match({.min_security = 0.5}, links)), ElementsAre(2));
  EXPECT_THAT(ids(match({.max_rtt = milliseconds(20), .min_rate = DataRate::mbit(11)}, links)),
              IsEmpty());
}

TEST(Match, KeepsWhatIsNotMeasuredYet) {
  const std::vector<LinkState> links{up(1)};
  EXPECT_THAT(
      ids(match({.max_rtt = milliseconds(1), .min_rate = DataRate::mbit(1000), .max_loss = 0},
                links)),
      ElementsAre(1));
}

TEST(Match, RanksByWeightedScore) {
  std::vector<LinkState> links{up(1), up(2), up(3)};
  links[0].nature = {.delay = 1.0, .bandwidth = 0.1, .reliability = 0.5};
  links[1].nature = {.delay = 0.2, .bandwidth = 1.0, .reliability = 0.5};
  links[2].nature = {.delay = 0.7, .bandwidth = 0.7, .reliability = 1.0};
  EXPECT_THAT(ids(match({.weights = {.delay = 1}}, links)), ElementsAre(1, 3, 2));
  EXPECT_THAT(ids(match({.weights = {.bandwidth = 1}}, links)), ElementsAre(2, 3, 1));
  EXPECT_THAT(ids(match({.weights = {.delay = 1, .bandwidth = 1}}, links)), ElementsAre(3, 2, 1));
  EXPECT_THAT(ids(match({.weights = {.delay = 2, .reliability = 0.1}}, links)),
              ElementsAre(1, 3, 2));
}

TEST(Match, TiesKeepTheOrderOfTheLinks) {
  const std::vector<LinkState> links{up(5), up(2), up(9), up(1)};
  EXPECT_THAT(ids(match({.weights = {.delay = 1}}, links)), ElementsAre(5, 2, 9, 1));
}

TEST(Match, GivesAtMostTheWantedNumber) {
  const std::vector<LinkState> links{up(1), up(2), up(3)};
  EXPECT_THAT(ids(match({.links = 0}, links)), IsEmpty());
  EXPECT_THAT(ids(match({.links = 2}, links)), ElementsAre(1, 2));
  EXPECT_THAT(ids(match({.links = 4}, links)), ElementsAre(1, 2, 3));
}

TEST(Match, WhatIsNotANumberRanksLast) {
  std::vector<LinkState> links{up(1), up(2), up(3)};
  links[0].nature.delay = std::numeric_limits<double>::quiet_NaN();
  links[1].nature.delay = 0.1;
  links[2].nature.delay = 0.2;
  EXPECT_THAT(ids(match({.weights = {.delay = 1}}, links)), ElementsAre(3, 2, 1));
}

TEST(Match, BackupsOnlyWhereNoNormalLinkMeetsTheFloors) {
  std::vector<LinkState> links{up(1), up(2), up(3)};
  links[0].traits.role = LinkRole::kBackup;
  links[0].rate = DataRate::mbit(50);
  links[1].rate = DataRate::mbit(10);
  links[2].rate = DataRate::mbit(5);
  EXPECT_THAT(ids(match({}, links)), ElementsAre(2, 3));
  EXPECT_THAT(ids(match({.min_rate = DataRate::mbit(8)}, links)), ElementsAre(2));
  EXPECT_THAT(ids(match({.min_rate = DataRate::mbit(20)}, links)), ElementsAre(1));
  EXPECT_THAT(ids(match({.min_rate = DataRate::mbit(80)}, links)), IsEmpty());
  links[1].up = links[2].up = false;
  EXPECT_THAT(ids(match({}, links)), ElementsAre(1));
}

TEST(Match, NeverMeansNever) {
  std::vector<LinkState> links{up(1), up(2)};
  links[0].traits.role = LinkRole::kNever;
  EXPECT_THAT(ids(match({}, links)), ElementsAre(2));
  links[1].up = false;
  EXPECT_THAT(match({}, links), IsEmpty());
}

TEST(Match, PriorityComesBeforeTheScoreAndAfterTheFloors) {
  std::vector<LinkState> links{up(1), up(2), up(3), up(4)};
  links[0].nature.delay = 1.0;
  links[1].nature.delay = 0.1;
  links[1].traits.priority = -1;
  links[2].nature.delay = 0.2;
  links[2].traits.priority = -1;
  links[3].nature.delay = 0.9;
  EXPECT_THAT(ids(match({.weights = {.delay = 1}}, links)), ElementsAre(3, 2, 1, 4));
  links[1].loss = links[2].loss = 0.5;
  EXPECT_THAT(ids(match({.max_loss = 0.1, .weights = {.delay = 1}}, links)), ElementsAre(1, 4));
}

TEST(RateFloor, IsTheRateThatKeepsUpWithThePeriod) {
  const QoS qos{.deadline = milliseconds(130), .period = milliseconds(100)};
  EXPECT_EQ(rate_floor(qos, 512 * 1024), DataRate{41'943'040});
  EXPECT_EQ(rate_floor(qos, 0), DataRate{0});
}

TEST(RateFloor, OfASporadicMessageIsTheRateThatArrivesByTheDeadline) {
  EXPECT_EQ(rate_floor({.deadline = milliseconds(50)}, 10'000), DataRate{1'600'000});
}

TEST(RateFloor, WithoutPeriodAndDeadlineThereIsNone) {
  EXPECT_EQ(rate_floor({}, 10'000), DataRate{0});
  EXPECT_EQ(rate_floor({.deadline = milliseconds(-1)}, 10'000), DataRate{0});
}

TEST(ArrivalTime, IsHalfTheRoundTripAndTheFragmentsAtTheRate) {
  LinkState link{.rtt_p95 = std::chrono::milliseconds(40), .rate = DataRate::mbit(8)};
  EXPECT_EQ(arrival_time(link, 0), std::chrono::milliseconds(20));
  // What fills a packet takes 1,428 bytes on the wire: 1.428 ms at 1 byte per µs.
  EXPECT_EQ(arrival_time(link, kMaxPieceBytes), std::chrono::microseconds(21'428));
  EXPECT_GT(arrival_time(link, kMaxMessageBytes), std::chrono::seconds(8));
}

TEST(ArrivalTime, IsNotKnownWhileTheLinkIsNotMeasured) {
  LinkState link;
  EXPECT_EQ(arrival_time(link, 1), Duration::max());
  link.rate = DataRate::mbit(8);
  EXPECT_EQ(arrival_time(link, 1), Duration::max());
  link.rtt_p95 = std::chrono::milliseconds(40);
  link.rate = {};
  EXPECT_EQ(arrival_time(link, 1), Duration::max());
}

}  // namespace
}  // namespace interneuron::requirement_test
