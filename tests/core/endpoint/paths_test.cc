// Paths that are added, lost or forbidden: what the endpoint's door promises of links. (The pipe
// has no bottleneck, so that no rate is ever learnt; tests/lab/sim measures.)
#include <gtest/gtest.h>

#include <algorithm>

#include "pipe.h"

namespace interneuron::paths_test {
namespace {

struct Paths : testing::Test {
  Paths() {
    vehicle = pipe.add_host(options_of(1, {pipeline_of({kComm, kComm})}, false));
    road = pipe.add_host(options_of(2));
    pipe.on_event = [this](std::size_t host, Event& event) {
      if (auto* change = std::get_if<PathChanged>(&event)) {
        changes.emplace_back(host, std::move(*change));
      } else if (auto* planned = std::get_if<Planned>(&event); planned != nullptr && host == 0) {
        plan = planned->plan;
      }
    };
    peer = pipe.connect(vehicle, road);
  }
  Endpoint& endpoint() { return pipe.at(vehicle); }
  TimePoint now() const { return pipe.local(vehicle); }
  LinkState link(LinkId id) {
    for (const LinkState& state : endpoint().links(now(), peer)) {
      if (state.id == id) return state;
    }
    return {};
  }
  void set_traits(LinkId id, const LinkTraits& traits) {
    endpoint().remove_link(now(), id);
    endpoint().add_link(now(), id, {"nic", 1500, traits});
    EXPECT_TRUE(endpoint().add_path(now(), peer, id, address_of(road)));
    pipe.flush(vehicle);
  }
  bool sends_over(LinkId id) {
    return std::ranges::find(plan.sends, id, &Assignment::link) != plan.sends.end();
  }

  Pipe pipe;
  std::size_t vehicle = 0;
  std::size_t road = 0;
  PeerId peer{};
  std::vector<std::pair<std::size_t, PathChanged>> changes;
  Plan plan;
};

TEST_F(Paths, TellsWhenAPathIsFirstHeard) {
  pipe.run(100ms);
  for (const LinkId id : {kFast, kSlow}) {
    const auto first = std::ranges::find_if(
        changes, [&](const auto& c) { return c.first == vehicle && c.second.link == id; });
    ASSERT_NE(first, changes.end());
    EXPECT_EQ(first->second.peer, peer);
    EXPECT_EQ(first->second.from, PathState::kDead);
    EXPECT_EQ(first->second.to, PathState::kOk);
    EXPECT_FALSE(first->second.reason.empty());
    EXPECT_EQ(link(id).path, PathState::kOk);
    EXPECT_TRUE(link(id).up);
  }
}

TEST_F(Paths, ARemovedLinkIsToldAndGone) {
  pipe.run(1s);
  changes.clear();
  endpoint().remove_link(now(), kFast);
  pipe.flush(vehicle);
  ASSERT_EQ(changes.size(), 1U);
  EXPECT_EQ(changes[0].second.link, kFast);
  EXPECT_EQ(changes[0].second.to, PathState::kDead);
  EXPECT_EQ(endpoint().links(now(), peer).size(), 1U);
  // Removed again, or never there: nothing happens.
  endpoint().remove_link(now(), kFast);
  endpoint().remove_link(now(), LinkId{77});
  pipe.flush(vehicle);
  EXPECT_EQ(changes.size(), 1U);
}

TEST_F(Paths, AReturnedLinkIsUsedAgain) {
  pipe.run(1s);
  endpoint().remove_link(now(), kFast);
  pipe.flush(vehicle);
  pipe.run(3s);
  endpoint().add_link(now(), kFast, {"nic", 1500, {}});
  EXPECT_TRUE(endpoint().add_path(now(), peer, kFast, address_of(road)));
  EXPECT_TRUE(endpoint().add_path(now(), peer, kFast, address_of(road)));  // nothing new
  pipe.flush(vehicle);
  pipe.run(50ms);
  EXPECT_TRUE(link(kFast).up);
  pipe.run(950ms);
  pipe.round(vehicle, PipelineId{0}, {Bytes(100'000)}, peer);
  EXPECT_TRUE(sends_over(kFast));
}

TEST_F(Paths, OnlyOfPeersWeConnectedToAndLinksThatAreThere) {
  pipe.run(1s);
  EXPECT_FALSE(endpoint().add_path(now(), PeerId{99}, kFast, address_of(road)));
  EXPECT_FALSE(endpoint().add_path(now(), peer, LinkId{9}, address_of(road)));
  endpoint().remove_link(now(), kFast);
  EXPECT_FALSE(endpoint().add_path(now(), peer, kFast, address_of(road)));
  Endpoint& acceptor = pipe.at(road);
  ASSERT_EQ(acceptor.peers().size(), 1U);
  EXPECT_FALSE(
      acceptor.add_path(pipe.local(road), acceptor.peers()[0], kFast, address_of(vehicle)));
}

TEST_F(Paths, AForbiddenLinkIsMeasuredAndNotUsed) {
  pipe.run(1s);
  LinkTraits never{.role = LinkRole::kNever};
  set_traits(kFast, never);
  pipe.run(2s);
  EXPECT_EQ(link(kFast).path, PathState::kOk);
  EXPECT_FALSE(link(kFast).up);
  EXPECT_EQ(link(kFast).traits, never);
  EXPECT_GT(link(kFast).rtt_p50, 0ns);
  pipe.round(vehicle, PipelineId{0}, {Bytes(2'000)}, peer);
  EXPECT_FALSE(sends_over(kFast));
  EXPECT_TRUE(sends_over(kSlow));
}

TEST_F(Paths, ABackupIsUsedWhenNothingElseIsUp) {
  pipe.run(1s);
  LinkTraits backup{.role = LinkRole::kBackup};
  set_traits(kFast, backup);
  pipe.run(2s);
  pipe.round(vehicle, PipelineId{0}, {Bytes(100'000)}, peer);
  EXPECT_FALSE(sends_over(kFast));
  endpoint().remove_link(now(), kSlow);
  pipe.flush(vehicle);
  pipe.round(vehicle, PipelineId{0}, {Bytes(100'000)}, peer);
  EXPECT_TRUE(sends_over(kFast));
}

TEST_F(Paths, ARateCapBoundsWhatIsBelievedAndSent) {
  pipe.run(1s);
  LinkTraits capped{.rate_cap = DataRate::mbit(2)};
  set_traits(kFast, capped);
  set_traits(kSlow, capped);
  pipe.run(2s);
  EXPECT_LE(link(kFast).rate, DataRate::mbit(2));
  std::vector<Pipe::Captured> captured;
  pipe.capture = &captured;
  pipe.round(vehicle, PipelineId{0}, {Bytes(200'000)}, peer);
  pipe.run(100ms);
  pipe.capture = nullptr;
  std::map<LinkId, std::size_t> bytes;
  for (const auto& packet : captured) {
    if (packet.from == vehicle && packet.is_data()) {
      bytes[packet.link] += packet.bytes.size() + 28;
    }
  }
  for (const auto& [id, sum] : bytes) EXPECT_LE(sum, 25'000U * 11 / 10 + 2 * 1428);
}

TEST_F(Paths, TrainsAreRequestedOfPathsThatAreThere) {
  pipe.run(1s);
  EXPECT_TRUE(endpoint().request_train(now(), peer, kSlow));
  EXPECT_FALSE(endpoint().request_train(now(), peer, LinkId{9}));
  EXPECT_FALSE(endpoint().request_train(now(), PeerId{99}, kSlow));
}

// A packet of the vehicle that somebody recorded and sends again from elsewhere is a duplicate; the
// road goes on to send where the vehicle is. A new packet from elsewhere is asked to prove that the
// vehicle is there (Join.APathMovesOnceItsNewAddressIsProved).
TEST_F(Paths, ReplayDoesNotMoveThePath) {
  constexpr std::size_t kElsewhere = 77;
  std::vector<Pipe::Captured> captured;
  pipe.capture = &captured;
  pipe.run(1s);
  pipe.capture = nullptr;
  const auto is_vehicles = [this](const Pipe::Captured& c) {
    return c.from == vehicle && c.link == kFast;
  };
  const auto old = std::ranges::find_if(captured, is_vehicles);
  ASSERT_NE(old, captured.end());
  int strayed = 0;
  int sent = 0;
  pipe.on_transmit = [&](std::size_t from, std::size_t to, LinkId, const Bytes&) {
    strayed += from == road && to == kElsewhere;
    sent += from == road && to == vehicle;
  };
  const auto hear_from_elsewhere = [&](const Bytes& bytes) {
    pipe.at(road).handle_datagram(pipe.local(road), {kFast, address_of(kElsewhere), bytes});
    pipe.flush(road);
  };
  const std::uint64_t before = pipe.at(road).link_counters(kFast).duplicate_packets;
  hear_from_elsewhere(old->bytes);
  EXPECT_EQ(pipe.at(road).link_counters(kFast).duplicate_packets, before + 1);
  pipe.run(1s);
  EXPECT_EQ(strayed, 0);
  EXPECT_GT(sent, 0);

  // The vehicle's next packet is seen to come from there, as behind a translator of addresses.
  std::vector<Pipe::Captured> next;
  pipe.cut = {kFast};
  pipe.capture = &next;
  pipe.run(500ms);
  pipe.capture = nullptr;
  const auto fresh = std::ranges::find_if(next, is_vehicles);
  ASSERT_NE(fresh, next.end());
  hear_from_elsewhere(fresh->bytes);
  pipe.run(500ms);
  EXPECT_EQ(strayed, 1);
}

}  // namespace
}  // namespace interneuron::paths_test
