#include "interneuron/endpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "pair.h"

namespace interneuron::endpoint_test {
namespace {

TEST(Endpoint, BothSidesBecomeReady) {
  Pair p;
  EXPECT_EQ(p.ready, 2);
  EXPECT_EQ(p.pipe.at(p.vehicle).links(p.pipe.local(p.vehicle), p.peer).size(), 2U);
}

TEST(Endpoint, ARoundGoesThereAndBack) {
  Pair p;
  p.rounds(1, {Bytes(20'000, std::byte{7})});
  ASSERT_EQ(p.delivered.size(), 1U);
  EXPECT_EQ(p.delivered[0].payload, Bytes(20'000, std::byte{7}));
  EXPECT_EQ(p.delivered[0].stage, 1);
  EXPECT_EQ(p.delivered[0].deadline, 130ms);
  EXPECT_EQ(p.delivered[0].qos.period, 100ms);
  EXPECT_EQ(p.delivered[0].qos.needs.delay, 1.0);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kRemote);
  EXPECT_EQ(p.done[0].result.size(), 100U);
}

TEST(Endpoint, ASmallResultGoesOverEveryLinkAndTheFirstCopyCounts) {
  Pair p;
  std::vector<Pipe::Captured> captured;
  p.pipe.capture = &captured;
  p.rounds(1);
  for (const LinkId link : {kFast, kSlow}) {
    EXPECT_EQ(std::ranges::count_if(captured,
                                    [&p, link](const Pipe::Captured& c) {
                                      return c.from == p.road && c.link == link && c.is_data();
                                    }),
              1);
  }
  const EndpointCounters c = p.pipe.at(p.vehicle).counters();
  EXPECT_EQ(c.messages_completed, 1U);
  EXPECT_EQ(c.messages_late, 0U);
  p.pipe.plan(15ms, [&p] { p.pipe.cut = {kFast}; });  // the other copy still counts
  p.rounds(1, {Bytes(1000)});
  ASSERT_EQ(p.done.size(), 2U);
  EXPECT_EQ(p.done[1].outcome, Outcome::kRemote);
}

TEST(Endpoint, TheSmallerVariantOfAResultThatIsThereIsSuperseded) {
  Pair p({pipeline_of({kComm, kComm})});
  p.answer = false;
  p.pipe.on_event = [&p, inner = p.pipe.on_event](std::size_t host, Event& e) {
    inner(host, e);
    if (auto* d = std::get_if<Delivered>(&e)) {
      p.pipe.at(host).submit(p.pipe.local(host), d->round, {Bytes(8'000), Bytes(6'000)},
                             MessageClass::kResult);
    }
  };
  p.rounds(3);
  ASSERT_EQ(p.done.size(), 3U);
  EXPECT_EQ(p.done[2].result.size(), 8'000U);
  const EndpointCounters c = p.pipe.at(p.vehicle).counters();
  EXPECT_EQ(c.messages_completed, 6U);
  EXPECT_EQ(c.messages_superseded, 3U);
  EXPECT_EQ(c.messages_late, 0U);
}

// Data packets of `host` over the slow link in a round in which it loses its fast one, with a large
// message on its way. Only the fast one is trusted.
std::ptrdiff_t sent_over_the_other_link(const char* policy, std::size_t host) {
  PipelineConfig config = pipeline_of(kOffload);
  config.policy = policy;
  Pipe pipe;
  pipe.add_host(options_of(1, {config}));
  pipe.add_host(options_of(2));
  for (const std::size_t h : {0U, 1U}) {
    pipe.at(h).add_link(pipe.local(h), kFast, {"nic", 1500, {.trusted = true}});
  }
  std::size_t done = 0;
  const auto lose = [&] {
    pipe.at(host).remove_link(pipe.local(host), kFast);
    pipe.flush(host);
  };
  pipe.on_event = [&](std::size_t at, Event& e) {
    if (std::holds_alternative<RoundDone>(e)) ++done;
    const auto* d = std::get_if<Delivered>(&e);
    if (d == nullptr) return;
    pipe.plan(1ms, [&pipe, at, ref = d->round] { pipe.submit(at, ref, 60'000); });
    if (host == at) pipe.plan(2ms, lose);
  };
  pipe.connect(0, 1);
  pipe.run(2s);
  std::vector<Pipe::Captured> captured;
  pipe.capture = &captured;
  pipe.round(0, PipelineId{0}, {Bytes(host == 0 ? 60'000 : 1'000)});
  if (host == 0) lose();
  pipe.run(500ms);
  EXPECT_EQ(done, 1U);
  return std::ranges::count_if(captured, [host](const Pipe::Captured& c) {
    return c.link == kSlow && c.from == host && c.is_data();
  });
}

TEST(Endpoint, WhatIsLostOfASecureMessageIsNotSentAgainOverAForeignLink) {
  for (const std::size_t host : {0U, 1U}) {
    EXPECT_GT(sent_over_the_other_link("best_link", host), 0);
    EXPECT_EQ(sent_over_the_other_link("secure", host), 0);
    EXPECT_EQ(sent_over_the_other_link("trusted_only", host), 0);
  }
}

// A policy that keeps every round on the vehicle.
class StayHome final : public Policy {
 public:
  std::string_view name() const override { return "stay_home"; }
  Plan plan(const Offer&, std::span<const LinkState>, const Guidance&) const override { return {}; }
  Merge merge(const Arrival&) const override { return Merge::kDeliver; }
};

TEST(Endpoint, ARoundThatItsPolicyKeepsHereIsAnsweredByItsLocalResultAtOnce) {
  Pipe pipe;
  EndpointOptions vehicle = options_of(1, {pipeline_of(kOffload)});
  vehicle.pipelines[0].policy = "stay_home";
  vehicle.policies.push_back(std::make_shared<const StayHome>());
  pipe.add_host(vehicle);
  pipe.add_host(options_of(2));
  std::vector<RoundDone> done;
  pipe.on_event = [&done](std::size_t, Event& e) {
    if (auto* r = std::get_if<RoundDone>(&e)) done.push_back(*r);
  };
  pipe.connect(0, 1);
  pipe.run(1s);
  for (int i = 0; i < 20; ++i) {
    const RoundRef ref = pipe.round(0);
    EXPECT_EQ(pipe.submitted, SubmitStatus::kRefusedByPolicy);
    pipe.plan(9ms, [&pipe, ref] {
      pipe.at(0).local_result(pipe.local(0), ref, Bytes(7));
      pipe.flush(0);
    });
    pipe.run(100ms);
  }
  pipe.run(1s);
  ASSERT_EQ(done.size(), 20U);
  for (const RoundDone& r : done) {
    EXPECT_EQ(r.outcome, Outcome::kLocal);
    EXPECT_EQ(r.e2e, 9ms);
    EXPECT_EQ(r.age_rounds, 0U);
    EXPECT_FALSE(r.recovering);  // no miss
  }
}

TEST(Endpoint, AResultAfterTheDeadlineIsLateAndCounted) {
  Pair p;
  p.compute = 122ms;  // leaves the roadside in time and arrives too late
  p.rounds(1, {Bytes(1000)});
  p.pipe.run(500ms);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kLocal);
  EXPECT_EQ(p.done[0].e2e, 130ms);
  EXPECT_EQ(p.pipe.at(p.vehicle).counters().messages_late, 1U);
}

TEST(Endpoint, TheSampledVariantIsHeldAndRawSupersedesIt) {
  Pair p;
  p.rounds(5);
  // Raw over the fast link, now a little later than the sampled copy but within D1.
  p.pipe.extra_from_0[kFast] = 4ms;
  p.rounds(1);
  ASSERT_EQ(p.delivered.size(), 6U);
  EXPECT_EQ(p.delivered[5].variant, 0);
  EXPECT_FALSE(p.delivered[5].verdict.released_at_deadline);
  EXPECT_FALSE(p.delivered[5].verdict.late);
}

TEST(Endpoint, TheSampledVariantIsReleasedAtD1AndRawAfterwardsSuperseded) {
  for (const Duration clock : {0ns, Duration(1h + 3ns), Duration(-1h)}) {
    Pair p({pipeline_of(kOffload)}, clock);
    p.rounds(5);
    const auto before = p.pipe.at(p.road).counters().messages_superseded;
    p.pipe.extra_from_0[kFast] = 90ms;
    p.rounds(1);
    ASSERT_EQ(p.delivered.size(), 6U);
    EXPECT_EQ(p.delivered[5].variant, 1);
    EXPECT_TRUE(p.delivered[5].verdict.released_at_deadline);
    EXPECT_FALSE(p.delivered[5].verdict.late);
    const Duration normal = p.delivered_at[4] - 1s - 400ms;
    EXPECT_GT(p.delivered_at[5] - 1s - 500ms, normal);
    p.pipe.run(100ms);
    EXPECT_EQ(p.pipe.at(p.road).counters().messages_superseded, before + 1);
  }
}

TEST(Endpoint, ADegradedMessageIsDeliveredAtOnce) {
  Pair p;
  p.rounds(3);
  p.answer = false;
  p.rounds(1);  // missed: the next round is sent degraded
  p.answer = true;
  p.pipe.run(100ms);
  const Duration begun = p.pipe.now();
  p.rounds(1);
  EXPECT_TRUE(p.delivered.back().degraded);
  EXPECT_EQ(p.delivered.back().variant, 1);
  EXPECT_LE(p.delivered_at.back() - begun, 8ms);
}

TEST(Endpoint, WithoutAnAnswerTheLocalResultCounts) {
  Pair p;
  p.answer = false;
  const RoundRef ref = p.pipe.round(p.vehicle);
  p.pipe.at(p.vehicle).local_result(p.pipe.local(p.vehicle), ref, Bytes(3));
  p.pipe.at(p.vehicle).local_result(p.pipe.local(p.vehicle),
                                    {SessionId{99}, PipelineId{0}, RoundId{0}}, Bytes(9));
  p.pipe.run(200ms);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kLocal);
  EXPECT_EQ(p.done[0].result.size(), 3U);
}

TEST(Endpoint, ARoundThatIsGivenUpIsAnsweredLocallyAtOnce) {
  Pair p;
  p.answer = false;
  const RoundRef ref = p.pipe.round(p.vehicle);
  p.pipe.at(p.vehicle).local_result(p.pipe.local(p.vehicle), ref, Bytes(3));
  p.pipe.run(20ms);
  ASSERT_TRUE(p.done.empty());
  const TimePoint now = p.pipe.local(p.vehicle);
  p.pipe.at(p.vehicle).give_up(now, {SessionId{99}, PipelineId{0}, RoundId{0}});
  p.pipe.at(p.vehicle).give_up(now, {ref.origin, PipelineId{77}, ref.round});
  p.pipe.at(p.vehicle).give_up(now, {ref.origin, ref.pipeline, RoundId{1000}});
  p.pipe.at(p.vehicle).give_up(now, ref);
  p.pipe.flush(p.vehicle);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kLocal);
  EXPECT_EQ(p.done[0].result.size(), 3U);
  EXPECT_LT(p.done[0].e2e, 30ms);
}

TEST(Endpoint, APipelineOfCommunicationsOnly) {
  Pair p({pipeline_of({kComm, kComm})});
  p.rounds(3);
  ASSERT_EQ(p.done.size(), 3U);
  EXPECT_EQ(p.done[2].outcome, Outcome::kRemote);
}

TEST(Endpoint, APipelineThatComputesFirst) {
  Pair p({pipeline_of({kComp, kComm, kComp, kComm})});
  for (int i = 0; i < 3; ++i) {
    const RoundRef ref = p.pipe.at(p.vehicle).begin_round(p.pipe.local(p.vehicle), PipelineId{0});
    p.pipe.plan(15ms, [&p, ref] { p.pipe.submit(p.vehicle, ref, 5'000); });
    p.pipe.run(100ms);
  }
  ASSERT_EQ(p.done.size(), 3U);
  EXPECT_EQ(p.delivered.at(0).stage, 2);
  EXPECT_EQ(p.done[2].outcome, Outcome::kRemote);
}

TEST(Endpoint, APipelineThatComputesAtTheEnd) {
  Pair p({pipeline_of({kComm, kComm, kComp})});
  p.pipe.on_event = [&p, inner = p.pipe.on_event](std::size_t host, Event& e) {
    inner(host, e);
    if (auto* d = std::get_if<Delivered>(&e); d != nullptr && host == p.vehicle) {
      p.pipe.plan(10ms, [&p, ref = d->round] {
        EXPECT_EQ(p.pipe.submit(p.vehicle, ref, 77), SubmitStatus::kAccepted);
      });
    }
  };
  p.rounds(1);
  ASSERT_EQ(p.done.size(), 1U);
  EXPECT_EQ(p.done[0].outcome, Outcome::kRemote);
  EXPECT_EQ(p.done[0].result.size(), 77U);
}

TEST(Endpoint, TwoPipelinesAtOnce) {
  Pair p({pipeline_of(kOffload, 0), pipeline_of({kComm, kComm}, 7)});
  for (int i = 0; i < 5; ++i) {
    p.pipe.round(p.vehicle, PipelineId{0});
    p.pipe.round(p.vehicle, PipelineId{7});
    p.pipe.run(100ms);
  }
  EXPECT_EQ(p.done.size(), 10U);
  for (const RoundDone& d : p.done) EXPECT_EQ(d.outcome, Outcome::kRemote);
  EXPECT_EQ(std::ranges::count(p.done, PipelineId{7},
                               [](const RoundDone& d) { return d.round.pipeline; }),
            5);
}

TEST(Endpoint, ARoundThatThePolicyKeepsLocalIsNoMiss) {
  PipelineConfig config = pipeline_of(kOffload);
  config.policy = "secure";  // and no link is trusted
  Pair p({config});
  for (int i = 0; i < 3; ++i) {
    const RoundRef ref = p.pipe.round(p.vehicle);
    EXPECT_EQ(p.pipe.submitted, SubmitStatus::kRefusedByPolicy);
    p.pipe.at(p.vehicle).local_result(p.pipe.local(p.vehicle), ref, Bytes(7));
    p.pipe.run(200ms);
  }
  EXPECT_EQ(p.refused, 3);
  EXPECT_TRUE(p.delivered.empty());
  ASSERT_EQ(p.done.size(), 3U);
  for (const RoundDone& done : p.done) {
    EXPECT_EQ(done.outcome, Outcome::kLocal);
    EXPECT_EQ(done.result.size(), 7U);
    EXPECT_FALSE(done.recovering);
    EXPECT_EQ(done.x_permille, 0);
  }
}

// --- arguments

TEST(Endpoint, ARoundThatIsNotKnownIsNotSubmitted) {
  Pair p;
  EXPECT_EQ(p.pipe.submit(p.vehicle, {SessionId{1}, PipelineId{0}, RoundId{5}}, 10),
            SubmitStatus::kUnknownRound);
  EXPECT_EQ(p.pipe.submit(p.vehicle, {SessionId{9}, PipelineId{3}, RoundId{5}}, 10),
            SubmitStatus::kUnknownRound);
  const RoundRef ref = p.pipe.round(p.vehicle);
  EXPECT_EQ(p.pipe.submit(p.vehicle, ref, 10), SubmitStatus::kRoundOver);  // once
  const RoundRef other = p.pipe.at(p.vehicle).begin_round(p.pipe.local(p.vehicle), PipelineId{0});
  EXPECT_EQ(p.pipe.submit(p.vehicle, other, 10, PeerId{99}), SubmitStatus::kNoPeer);
  const RoundRef late = p.pipe.at(p.vehicle).begin_round(p.pipe.local(p.vehicle), PipelineId{0});
  p.pipe.run(200ms);
  EXPECT_EQ(p.pipe.submit(p.vehicle, late, 10), SubmitStatus::kRoundOver);
}

// Memory of messages is used again: what a round left in it is not told of the next message.
TEST(Endpoint, PiecesOfAPlainMessageBearNoRoundWhateverWasSentBefore) {
  Pair p;
  std::vector<Pipe::Captured> captured;
  p.pipe.capture = &captured;
  const auto pieces_with_round = [&](bool any) {
    return std::ranges::count_if(captured, [&p, any](const Pipe::Captured& c) {
      return c.from == p.vehicle && c.is_data() && (any || c.round);
    });
  };
  p.rounds(1);
  EXPECT_GT(pieces_with_round(false), 0);
  captured.clear();
  p.pipe.at(p.vehicle).send(p.pipe.local(p.vehicle), p.peer, {Bytes(20'000)}, {.deadline = 300ms});
  p.pipe.flush(p.vehicle);
  p.pipe.run(400ms);
  EXPECT_GE(pieces_with_round(true), 15);
  EXPECT_EQ(pieces_with_round(false), 0);
}

TEST(Endpoint, WrongArgumentsThrowAndChangeNothing) {
  const auto make = [](EndpointOptions o) { return Endpoint(std::move(o), TimePoint{}); };
  EXPECT_THROW(make(options_of(0)), std::invalid_argument);
  EXPECT_THROW(make(options_of(1, {pipeline_of({})})), std::invalid_argument);
  EXPECT_THROW(make(options_of(1, {pipeline_of({kComm})})), std::invalid_argument);
  EXPECT_THROW(make(options_of(1, {pipeline_of(kOffload), pipeline_of(kOffload)})),
               std::invalid_argument);
  EXPECT_THROW(make(options_of(1, {pipeline_of(std::vector<StageKind>(17, kComm))})),
               std::invalid_argument);
  EndpointOptions nameless = options_of(1, {pipeline_of(kOffload)});
  nameless.pipelines[0].policy = "no_such";
  EXPECT_THROW(make(nameless), std::invalid_argument);
  EndpointOptions bare = options_of(1);
  bare.policies.clear();
  EXPECT_THROW(make(bare), std::invalid_argument);
  bare.policies.push_back(nullptr);
  EXPECT_THROW(make(bare), std::invalid_argument);

  Endpoint e(options_of(1, {pipeline_of(kOffload)}), TimePoint{});
  EXPECT_THROW(e.begin_round(TimePoint{}, PipelineId{9}), std::invalid_argument);
  const std::pair<LinkId, Address> addresses[] = {{LinkId{5}, address_of(1)}};
  EXPECT_THROW(e.connect(TimePoint{}, addresses), std::invalid_argument);
  EXPECT_TRUE(e.peers().empty());
  const RoundRef ref = e.begin_round(TimePoint{}, PipelineId{0});
  EXPECT_THROW(e.submit(TimePoint{}, ref, {}, MessageClass::kData), std::invalid_argument);
  EXPECT_THROW(e.submit(TimePoint{}, ref, Variants(kMaxVariants + 1), MessageClass::kData),
               std::invalid_argument);
  EXPECT_THROW(e.submit(TimePoint{}, ref, {Bytes(kMaxMessageBytes + 1)}, MessageClass::kData),
               std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::endpoint_test
