// What `testbed verify` says of policers, shapers, grants, hybrid ARQ and sleep: each is measured
// on a link of the emulator's own model that does what the profile asks, and on one that does not.
#include <gtest/gtest.h>

#include <functional>

#include "lab/emu/link.h"
#include "netns/verify/carrier.h"
#include "verify_support.h"

namespace interneuron::netns::verify::verify_carrier_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kMbit = 20;
constexpr double kRttMs = 40;
using Change = std::function<void(emu::DirectionParams&)>;

// Sends a packet of these bytes up every so often and tells what arrives when.
std::vector<Datagram> carried(const Change& change, std::size_t bytes, Duration every,
                              Duration length) {
  emu::LinkProfile profile = emu::constant_link("made", kRttMs, kMbit, kMbit);
  change(profile.up);
  emu::Link link(profile, kSeed);
  std::vector<Datagram> out;
  const auto collect = [&](Duration until) {
    while (link.up().next_delivery() && *link.up().next_delivery() <= until) {
      const Duration at = *link.up().next_delivery();
      for (auto got = link.up().dequeue(at); got; got = link.up().dequeue(at)) {
        Datagram d = datagram(static_cast<std::uint32_t>(got->tag), at,
                              seconds(1) + static_cast<std::int64_t>(got->tag - 1) * every);
        d.ip_bytes = bytes;
        out.push_back(d);
      }
    }
  };
  std::uint64_t number = 0;
  for (Duration at = seconds(1); at < seconds(1) + length; at += every) {
    collect(at);
    link.up().enqueue(at, bytes, ++number);
  }
  collect(seconds(60));
  return out;
}

// The evidence of a link that does `done` where `asked` was asked for.
DirectionEvidence evidence(const Change& done, const Change& asked) {
  DirectionEvidence e;
  asked(e.asked.carrier);
  e.rate.carrier = e.asked.carrier;
  e.rate.schedule = constant(kRttMs, 0, kMbit);
  // 15 % more than the link's rate.
  const auto every = Duration{static_cast<std::int64_t>(1428 * 8e3 / kMbit / 1.15)};
  e.rate.received = carried(done, 1428, every, milliseconds(3500));
  const Duration between = milliseconds(2);
  for (Duration at = seconds(1); at < seconds(21); at += between) {
    e.flow.packets.push_back({at, 128, std::nullopt});
  }
  for (const Datagram& d : carried(done, 128, between, seconds(20))) {
    e.flow.packets[d.number - 1].arrived = d.seen;
  }
  return e;
}

std::vector<Figure> judged(const DirectionEvidence& e) {
  const Schedule schedule = constant(kRttMs, 0, kMbit);
  std::vector<Sent> sent;
  for (const Flow::Packet& p : e.flow.packets) {
    sent.push_back({p.sent, p.ip_bytes, !p.arrived.has_value()});
  }
  return judge_carrier("up", e, Direction::kUp, Course(schedule, Direction::kUp, sent));
}

// The names of the figures with this verdict, in their order.
std::vector<std::string> names(const std::vector<Figure>& figures, Verdict verdict) {
  std::vector<std::string> out;
  for (const Figure& figure : figures) {
    if (figure.verdict == verdict) out.push_back(figure.name);
  }
  return out;
}

struct Case {
  const char* name;
  Change asked;
  // The same, but wrong enough to be seen.
  Change wrong;
  std::vector<std::string> figures;
};

std::vector<Case> cases() {
  const auto bucket = [](double mbit, std::size_t bytes) {
    return emu::TokenBucketParams{DataRate::mbit(mbit), bytes};
  };
  return {
      {"Policer",
       [=](auto& p) { p.police = bucket(8, 60'000); },
       [=](auto& p) { p.police = bucket(10, 100'000); },
       {"up policer rate", "up policer drops", "up policer burst"}},
      {"Shaper",
       [=](auto& p) { p.shape = bucket(8, 60'000); },
       [=](auto& p) { p.shape = bucket(7, 90'000); },
       {"up shaper rate", "up shaper burst"}},
      {"Grants",
       [](auto& p) {
         p.grant_every = milliseconds(20);
         p.grant_share = 0.2;
       },
       [](auto& p) {
         p.grant_every = milliseconds(22);
         p.grant_share = 0.4;
       },
       {"up grant period", "up grant share"}},
      {"HybridArq",
       [](auto& p) {
         p.harq = 0.1;
         p.harq_by = milliseconds(8);
       },
       [](auto& p) {
         p.harq = 0.2;
         p.harq_by = milliseconds(10);
       },
       {"up HARQ step", "up HARQ late"}},
  };
}

class VerifyCarrier : public testing::TestWithParam<Case> {};

TEST_P(VerifyCarrier, WhatDoesAsAskedPasses) {
  const auto figures = judged(evidence(GetParam().asked, GetParam().asked));
  EXPECT_EQ(names(figures, Verdict::kOk), GetParam().figures);
  EXPECT_EQ(figures.size(), GetParam().figures.size());
}

TEST_P(VerifyCarrier, WhatDoesOtherwiseFails) {
  const auto figures = judged(evidence(GetParam().wrong, GetParam().asked));
  EXPECT_EQ(names(figures, Verdict::kFailed), GetParam().figures);
}

INSTANTIATE_TEST_SUITE_P(Keys, VerifyCarrier, testing::ValuesIn(cases()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(VerifyCarrierFigures, ALinkThatDoesNothingHasNoFigures) {
  EXPECT_TRUE(judged(evidence([](auto&) {}, [](auto&) {})).empty());
}

TEST(VerifyCarrierFigures, ABucketThatIsNotEmptiedHasNoVerdict) {
  const Change large = [](auto& p) { p.police = {DataRate::mbit(19), 10'000'000}; };
  const auto figures = judged(evidence(large, large));
  ASSERT_EQ(figures.size(), 1U);
  EXPECT_EQ(figures[0].verdict, Verdict::kNotMeasured);
}

TEST(VerifyCarrierFigures, AWakeUpIsAsLongAsAsked) {
  DirectionEvidence e;
  e.asked.carrier.wake_by = milliseconds(200);
  e.woke_after = milliseconds(207);
  EXPECT_EQ(names(judged(e), Verdict::kOk), std::vector<std::string>{"up wake-up"});
  e.woke_after = milliseconds(100);
  EXPECT_EQ(names(judged(e), Verdict::kFailed), std::vector<std::string>{"up wake-up"});
  e.woke_after.reset();
  EXPECT_EQ(names(judged(e), Verdict::kNotMeasured), std::vector<std::string>{"up wake-up"});
}

}  // namespace
}  // namespace interneuron::netns::verify::verify_carrier_test
