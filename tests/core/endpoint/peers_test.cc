// Peers and links that come, restart, vanish and are refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "interneuron/endpoint.h"
#include "pair.h"

namespace interneuron::peers_test {
namespace {

TEST(Endpoint, ARestartedRoadsideIsRecognisedAndServesOn) {
  Pair p;
  p.rounds(2);
  p.pipe.restart(p.road, options_of(3));
  p.pipe.run(1s);
  EXPECT_EQ(p.restarted, 1);
  p.rounds(1);
  EXPECT_EQ(p.done.back().outcome, Outcome::kRemote);
}

TEST(Endpoint, ARestartedVehicleIsAnotherPeer) {
  Pair p;
  p.rounds(2);
  p.pipe.restart(p.vehicle, options_of(4, {pipeline_of(kOffload)}, false));
  p.pipe.connect(p.vehicle, p.road);
  p.pipe.run(1s);
  p.rounds(1);
  EXPECT_EQ(p.done.back().outcome, Outcome::kRemote);
  EXPECT_EQ(p.pipe.at(p.road).peers().size(), 2U);
  p.pipe.run(61s);
  EXPECT_EQ(p.pipe.at(p.road).peers().size(), 1U);
  EXPECT_EQ(p.lost, 1);
}

TEST(Endpoint, AVehicleThatWasOutOfReachForLongIsServedAgainAtOnce) {
  Pair p;
  p.rounds(20);
  p.pipe.cut = {kFast, kSlow};
  p.pipe.run(90s);
  EXPECT_EQ(p.lost, 1);
  EXPECT_TRUE(p.pipe.at(p.road).peers().empty());
  p.pipe.cut.clear();
  p.pipe.run(2s);
  p.rounds(1);
  EXPECT_EQ(p.done.back().outcome, Outcome::kRemote);
}

TEST(Endpoint, LinksThatComeBackAreConnectedAgain) {
  Pair p;
  p.rounds(20);
  for (const LinkId link : {kFast, kSlow}) {
    p.pipe.at(p.vehicle).remove_link(p.pipe.local(p.vehicle), link);
  }
  p.pipe.run(1s);
  for (const LinkId link : {kFast, kSlow}) {
    p.pipe.at(p.vehicle).add_link(p.pipe.local(p.vehicle), link, {"nic", 1500});
  }
  const PeerId again = p.pipe.connect(p.vehicle, p.road);
  p.pipe.run(1s);
  p.pipe.round(p.vehicle, PipelineId{0}, {Bytes(1000)}, again);
  p.pipe.run(100ms);
  EXPECT_EQ(p.done.back().outcome, Outcome::kRemote);
}

TEST(Endpoint, WhoIsNotServedIsRefusedAndCounted) {
  Pipe pipe;
  const auto vehicle = pipe.add_host(options_of(1, {pipeline_of(kOffload)}, false));
  const auto road = pipe.add_host(options_of(2, {}, false));
  pipe.connect(vehicle, road);
  pipe.run(1s);
  EXPECT_TRUE(pipe.at(road).peers().empty());
  const LinkCounters c = pipe.at(road).link_counters(kFast);
  EXPECT_GT(c.refused_packets, 0U);
  EXPECT_EQ(c.received_packets, 0U);
  EXPECT_EQ(c.sent_packets, 0U);
}

TEST(Endpoint, UnannouncedPeersAreBounded) {
  Pipe pipe;
  EndpointOptions o = options_of(100);
  o.max_peers = 2;
  const auto road = pipe.add_host(std::move(o));
  for (std::uint32_t i = 1; i <= 3; ++i) {
    pipe.connect(pipe.add_host(options_of(i, {pipeline_of(kOffload)}, false)), road);
  }
  pipe.run(1s);
  EXPECT_EQ(pipe.at(road).peers().size(), 2U);
  EXPECT_GT(pipe.at(road).link_counters(kFast).refused_packets, 0U);
}

TEST(Endpoint, ALinkThatVanishesMidMessageHandsOver) {
  Pair p;
  p.rounds(3);
  p.pipe.round(p.vehicle, PipelineId{0}, {Bytes(100'000)});
  p.pipe.run(10ms);
  p.pipe.at(p.vehicle).remove_link(p.pipe.local(p.vehicle), kFast);
  p.pipe.flush(p.vehicle);
  p.pipe.run(200ms);
  EXPECT_EQ(p.done.back().outcome, Outcome::kRemote);
  EXPECT_GT(p.pipe.at(p.vehicle).link_counters(kSlow).fragments_resent, 0U);
}

}  // namespace
}  // namespace interneuron::peers_test
