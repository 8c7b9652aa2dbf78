// One endpoint with many peers: each is served as if it were alone, and shared memory is shared.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "core/base/shared_memory.h"
#include "pair.h"

namespace interneuron::many_peers_test {
namespace {

// What a road sends to one vehicle over each link: the bytes of every datagram. Of two links that
// send at one instant, either may be first.
using Sent = std::map<LinkId, std::vector<Bytes>>;

struct Said {
  Duration at{};
  std::size_t vehicle = 0;
  std::size_t bytes = 0;
};

// The datagrams that each vehicle of `vehicles` gets from a road that answers all of them. Vehicles
// have the same numbers and sessions whoever else is there.
std::map<std::size_t, Sent> served(const std::set<std::size_t>& vehicles, std::size_t hosts,
                                   const std::vector<Said>& said) {
  Pipe pipe;
  std::map<std::size_t, Sent> out;
  for (std::size_t i = 0; i < hosts; ++i) {
    const auto session = static_cast<std::uint32_t>(i + 1);
    pipe.add_host(options_of(session, {pipeline_of({kComm, kComm})}, false));
  }
  const std::size_t road = pipe.add_host(options_of(1000));
  pipe.on_event = [&](std::size_t host, Event& event) {
    const auto* delivered = std::get_if<Delivered>(&event);
    if (host == road && delivered != nullptr) {
      pipe.plan(3ms, [&pipe, road, ref = delivered->round] { pipe.submit(road, ref, 3000); });
    }
  };
  pipe.on_transmit = [&](std::size_t from, std::size_t to, LinkId link, const Bytes& bytes) {
    if (from == road) out[to][link].push_back(bytes);
  };
  for (const std::size_t vehicle : vehicles) pipe.connect(vehicle, road);
  for (const Said& s : said) {
    if (!vehicles.contains(s.vehicle)) continue;
    pipe.plan(s.at, [&pipe, s] { pipe.round(s.vehicle, PipelineId{0}, {Bytes(s.bytes)}); });
  }
  pipe.run(3s);
  return out;
}

RC_GTEST_PROP(ManyPeers, AreServedAsIfEachWereAlone, ()) {
  const auto hosts = *rc::gen::inRange<std::size_t>(2, 6);
  std::vector<Said> said;
  const int rounds = *rc::gen::inRange(0, 20);
  for (int i = 0; i < rounds; ++i) {
    // No two rounds begin at one instant, and no two of the same vehicle within its deadline.
    said.push_back({500ms + i * 100ms, *rc::gen::inRange<std::size_t>(0, hosts),
                    *rc::gen::inRange<std::size_t>(1, 40'000)});
  }
  std::set<std::size_t> all;
  for (std::size_t i = 0; i < hosts; ++i) all.insert(i);
  const auto together = served(all, hosts, said);
  for (const std::size_t vehicle : all) {
    const auto alone = served({vehicle}, hosts, said);
    RC_ASSERT(together.at(vehicle) == alone.at(vehicle));
  }
}

// Nobody may hold more than is left free, so whoever holds little finds room.
RC_GTEST_PROP(SharedMemory, LeavesRoomForWhoeverHoldsLittle, ()) {
  constexpr std::size_t kBudget = 1'000'000;
  SharedMemory memory(kBudget);
  std::vector<std::size_t> held(*rc::gen::inRange<std::size_t>(1, 12));
  const int steps = *rc::gen::inRange(0, 300);
  for (int i = 0; i < steps; ++i) {
    std::size_t& mine = held[*rc::gen::inRange<std::size_t>(0, held.size())];
    const auto wanted = *rc::gen::inRange<std::size_t>(0, kBudget);
    // Either some of it is freed, or as much as may be is taken of what is wanted.
    const std::size_t after =
        *rc::gen::arbitrary<bool>() ? mine / 2 : mine + std::min(wanted, memory.room(mine));
    memory.change(mine, after);
    mine = after;
    RC_ASSERT(memory.used() <= kBudget);
    if (memory.room(0) == 0) RC_ASSERT(kBudget - memory.used() <= 1U);
  }
  // Greedy ones end with equal parts, and one such part is free.
  for (int turn = 0; turn < 2000; ++turn) {
    for (std::size_t& mine : held) {
      const std::size_t before = mine;
      mine = mine / 2 + std::min(mine, memory.room(mine / 2));
      memory.change(before, mine);
      const std::size_t more = memory.room(mine);
      memory.change(mine, mine + more);
      mine += more;
    }
  }
  const std::size_t fair = kBudget / (held.size() + 1);
  RC_ASSERT(kBudget - memory.used() >= fair / 2);
}

TEST(SharedMemory, OneAloneGetsHalf) {
  SharedMemory memory(1000);
  EXPECT_EQ(memory.room(0), 500U);
  memory.change(0, 500);
  EXPECT_EQ(memory.room(500), 0U);
  EXPECT_EQ(memory.room(0), 250U);
}

// However many vehicles an endpoint may have, it remembers the rounds of each.
TEST(ManyPeers, ARoundIsServedOnceWithAHundredVehicles) {
  constexpr std::uint32_t kVehicles = 100;
  Pipe pipe;
  const PipelineConfig pipeline = pipeline_of({kComm, kComm});
  for (std::uint32_t session = 1; session <= kVehicles; ++session) {
    pipe.add_host(options_of(session, {pipeline}, false));
  }
  EndpointOptions options = options_of(1000);
  options.max_peers = kVehicles;
  const std::size_t road = pipe.add_host(std::move(options));
  std::size_t delivered = 0;
  pipe.on_event = [&](std::size_t host, Event& e) {
    delivered += host == road && std::holds_alternative<Delivered>(e) ? 1 : 0;
  };
  for (std::size_t vehicle = 0; vehicle < kVehicles; ++vehicle) pipe.connect(vehicle, road);
  pipe.run(2s);
  for (std::size_t vehicle = 0; vehicle < kVehicles; ++vehicle) {
    pipe.round(vehicle, PipelineId{0}, {Bytes(8'000), Bytes(6'000)});
  }
  pipe.run(1s);
  EXPECT_EQ(delivered, kVehicles);
  EXPECT_GE(pipe.at(road).counters().messages_superseded, kVehicles);
}

// The endpoint's budget holds over all peers, and what is refused is counted and told; whoever
// needs little finds room beside one that takes what there is.
TEST(ManyPeers, ShareOneBudgetForIncompleteMessages) {
  Pipe pipe;
  for (std::uint32_t session = 1; session <= 4; ++session) {
    pipe.add_host(options_of(session, {pipeline_of({kComm, kComm})}, false));
  }
  EndpointOptions options = options_of(1000);
  options.reassembly_budget_bytes = 300'000;
  const std::size_t road = pipe.add_host(std::move(options));
  std::map<SessionId, int> delivered;
  std::size_t most = 0;
  pipe.on_event = [&](std::size_t, Event& e) {
    if (const auto* d = std::get_if<Delivered>(&e)) ++delivered[d->round.origin];
  };
  pipe.on_transmit = [&](std::size_t, std::size_t, LinkId, const Bytes&) {
    most = std::max(most, pipe.at(road).reassembly_bytes());
  };
  for (std::size_t vehicle = 0; vehicle < 4; ++vehicle) pipe.connect(vehicle, road);
  pipe.run(1s);
  for (std::size_t vehicle = 0; vehicle < 4; ++vehicle) {
    pipe.round(vehicle, PipelineId{0}, {Bytes(vehicle == 0 ? 400'000 : 20'000)});
  }
  pipe.run(1s);
  EXPECT_LE(most, 300'000U);
  EXPECT_GT(most, 0U);
  const std::map<SessionId, int> those_that_fit{
      {SessionId{2}, 1}, {SessionId{3}, 1}, {SessionId{4}, 1}};
  EXPECT_EQ(delivered, those_that_fit);
  EXPECT_GT(pipe.at(road).counters().reassembly_refused, 0U);
  EXPECT_EQ(pipe.at(road).reassembly_bytes(), 0U);
}

}  // namespace
}  // namespace interneuron::many_peers_test
