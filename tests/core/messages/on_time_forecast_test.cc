// What send() predicts: what the record of a peer does to it, and that nothing a peer says takes it
// out of range. Whether predictions are kept is measured by `interneuron bench forecast`.
#include "core/messages/on_time_forecast.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>

#include "tests/core/messages/door.h"

namespace interneuron::on_time_forecast_test {
namespace {

using messages::OnTimeForecasts;
using messages::Outlook;

using namespace std::chrono_literals;

constexpr PeerId kPeer{1};
constexpr PeerId kOther{2};

// A message to a link of 40 ms and 20 Mbit/s that nobody else uses.
Outlook outlook(Duration expected, PeerId peer = kPeer) {
  Outlook o{.peer = peer, .deadline = 150ms, .bytes = 30'000};
  o.refused = false;
  o.expected = expected;
  o.least = expected;
  o.rate = DataRate::mbit(20);
  return o;
}

// So many messages, all with this fate.
void live(OnTimeForecasts& forecasts, int messages, const MessageFate& fate, PeerId peer = kPeer) {
  static std::uint64_t next = 1;
  for (int i = 0; i < messages; ++i) {
    const SendId id{next++};
    const Outlook o = outlook(35ms, peer);
    forecasts.sent(id, o, forecasts.predict(o));
    MessageFate told = fate;
    told.id = id;
    forecasts.settled(told);
  }
}

constexpr MessageFate kGood{.fate = Fate::kDelivered, .age = 35ms};
constexpr MessageFate kMissed{.fate = Fate::kDropped, .reason = FateReason::kExpired};

TEST(OnTimeForecasts, MoreTimeToSpareNeverMakesAMessageLessLikely) {
  OnTimeForecasts forecasts;
  for (const bool refused : {false, true}) {
    for (int messages = 0; messages < 3; ++messages) {
      double last = 1;
      for (Duration expected = 1ms; expected < 400ms; expected += 1ms) {
        Outlook o = outlook(expected);
        o.refused = refused;
        const double p = forecasts.predict(o);
        EXPECT_LE(p, last);
        last = p;
      }
      EXPECT_LT(last, forecasts.predict(outlook(35ms)));
      live(forecasts, 20, messages == 0 ? kGood : kMissed);
    }
  }
}

TEST(OnTimeForecasts, AnIdleLinkIsLikelyAndOneThatIsNotKnownIsNotCertain) {
  const OnTimeForecasts forecasts;
  const double idle = forecasts.predict(outlook(35ms));
  EXPECT_GT(idle, 0.98);
  Outlook unknown{.peer = kPeer, .deadline = 150ms, .bytes = 30'000};
  unknown.refused = false;
  EXPECT_GT(forecasts.predict(unknown), 0.9);
  EXPECT_LT(forecasts.predict(unknown), idle);
  Outlook silent = outlook(35ms);
  silent.path = PathState::kSuspect;
  EXPECT_LT(forecasts.predict(silent), idle);
}

TEST(OnTimeForecasts, NoMessageSlipsThroughALinkThatIsTooLong) {
  const OnTimeForecasts forecasts;
  for (const std::size_t bytes : {1UL, 100UL, 1'200UL, 30'000UL, 1'000'000UL}) {
    Outlook o = outlook(300ms);
    o.refused = true;
    o.bytes = bytes;
    EXPECT_LT(forecasts.predict(o), 0.1) << bytes;
  }
}

TEST(OnTimeForecasts, MissesOfAPeerAreRememberedAndForgotten) {
  OnTimeForecasts forecasts;
  live(forecasts, 50, kGood);
  const double good = forecasts.predict(outlook(35ms));
  live(forecasts, 50, kMissed);
  const double bad = forecasts.predict(outlook(35ms));
  live(forecasts, 300, kGood);
  const double again = forecasts.predict(outlook(35ms));
  EXPECT_LT(bad, good - 0.1);
  EXPECT_NEAR(again, good, 0.02);
}

TEST(OnTimeForecasts, APeerSpoilsWhatIsPredictedOfItselfAlone) {
  OnTimeForecasts forecasts;
  const double fresh = forecasts.predict(outlook(35ms, kOther));
  live(forecasts, 50, kMissed);
  EXPECT_EQ(forecasts.predict(outlook(35ms, kOther)), fresh);
}

TEST(OnTimeForecasts, WhatTheApplicationGaveUpTeachesNothing) {
  OnTimeForecasts forecasts;
  const double fresh = forecasts.predict(outlook(35ms));
  for (const FateReason reason : {FateReason::kCancelled, FateReason::kSuperseded}) {
    live(forecasts, 50, {.fate = Fate::kDropped, .reason = reason});
  }
  EXPECT_EQ(forecasts.predict(outlook(35ms)), fresh);
}

TEST(OnTimeForecasts, APeerThatIsForgottenBeginsAnew) {
  OnTimeForecasts forecasts;
  const double fresh = forecasts.predict(outlook(35ms));
  live(forecasts, 50, kMissed);
  forecasts.forget(kPeer);
  EXPECT_EQ(forecasts.predict(outlook(35ms)), fresh);
}

TEST(OnTimeForecasts, WhatIsUnderWayMakesTheNextOneLessLikelyUntilItIsSettled) {
  OnTimeForecasts forecasts;
  const double before = forecasts.predict(outlook(35ms));
  Outlook large = outlook(35ms);
  large.bytes = 500'000;
  forecasts.sent(SendId{1'000'000}, large, before);
  EXPECT_LT(forecasts.predict(outlook(35ms)), before);
  forecasts.settled({.id = SendId{1'000'000}, .reason = FateReason::kCancelled});
  EXPECT_EQ(forecasts.predict(outlook(35ms)), before);
}

// Nothing that a peer or a link says leaves (0, 1), not even ages of hours.
RC_GTEST_PROP(OnTimeForecasts, APredictionIsAProbability, ()) {
  OnTimeForecasts forecasts;
  const auto ms = [](int from, int to) { return *rc::gen::inRange(from, to) * 1ms; };
  for (int i = *rc::gen::inRange(0, 40); i > 0; --i) {
    live(forecasts, 1,
         {.fate = static_cast<Fate>(*rc::gen::inRange(0, 4)), .age = ms(-7'200'000, 7'200'000)});
  }
  Outlook o = outlook(ms(0, 7'200'000));
  o.deadline = ms(1, 3'600'000);
  o.refused = *rc::gen::arbitrary<bool>();
  o.bytes = static_cast<std::size_t>(*rc::gen::inRange(1, 8'000'000));
  o.share = DataRate::mbit(*rc::gen::inRange(0, 1000));
  if (*rc::gen::arbitrary<bool>()) o.expected.reset();
  if (*rc::gen::arbitrary<bool>()) o.least.reset();
  const double p = forecasts.predict(o);
  RC_ASSERT(p > 0 && p < 1);
}

// The mean prediction of the last `judged` of so many messages, of which this share is on time.
double mean_prediction(OnTimeForecasts& forecasts, double share, int messages, int judged) {
  double sum = 0;
  double owed = 0;
  for (int i = 0; i < messages; ++i) {
    if (i >= messages - judged) sum += forecasts.predict(outlook(35ms)) / judged;
    owed += share;
    live(forecasts, 1, owed >= 1 ? kGood : kMissed);
    if (owed >= 1) owed -= 1;
  }
  return sum;
}

// Whatever the law says of a message, and whatever happens: the fates of earlier ones put it right.
RC_GTEST_PROP(OnTimeForecasts, FatesPutALawRightThatIsWrong, ()) {
  OnTimeForecasts forecasts;
  const double share = *rc::gen::inRange(10, 91) / 100.0;
  RC_ASSERT(std::abs(mean_prediction(forecasts, share, 1500, 500) - share) < 0.03);
}

TEST(SendOnTime, IsToldOfWhatIsAcceptedOrCannotArrive) {
  Door door;
  const SendResult fine = door.send({Bytes(1000)}, {.deadline = 200ms});
  ASSERT_TRUE(fine.accepted());
  ASSERT_TRUE(fine.on_time.has_value());
  EXPECT_GT(*fine.on_time, 0.8);
  const SendResult late = door.send({Bytes(1000)}, {.deadline = 1ns});
  ASSERT_EQ(late.status, SendStatus::kCannotArrive);
  EXPECT_TRUE(late.on_time.has_value());
  EXPECT_FALSE(door.send({Bytes()}).on_time.has_value());
}

}  // namespace
}  // namespace interneuron::on_time_forecast_test
