// What a fate says happened at the other end, also where what the peer tells is lost.
#include <gtest/gtest.h>

#include "door.h"

namespace interneuron::truth_test {
namespace {

EndpointOptions small_road() {
  EndpointOptions options = options_of(2);
  options.reassembly_budget_bytes = 200'000;
  return options;
}

std::optional<wire::Feedback> feedback_of(ByteView bytes) {
  const auto packet = wire::parse(bytes);
  if (!packet || packet->header.type != wire::PacketType::kFeedback) return std::nullopt;
  return packet->feedback;
}

TEST(Truth, AMessageThatThePeerRefusedIsDropped) {
  Door d(1h, small_road());
  const SendResult result = d.send({Bytes(150'000)});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(1s);
  EXPECT_TRUE(d.came.empty());
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(result.id).reason, FateReason::kRefusedByPeer);
  EXPECT_GT(d.pipe.at(d.road).counters().reassembly_refused, 0U);
}

TEST(Truth, AndIsNotDeliveredWhereThatIsNotHeardThoughItsPiecesAreAcknowledged) {
  Door d(1h, small_road());
  int lost = 0;
  d.pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    const auto feedback = from == d.road ? feedback_of(bytes) : std::nullopt;
    const bool drops = feedback && !feedback->refused.empty();
    lost += drops ? 1 : 0;
    return drops;
  };
  const SendResult result = d.send({Bytes(150'000)}, {.deadline = 500ms});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(2s);
  EXPECT_GT(lost, 0);
  EXPECT_TRUE(d.came.empty());
  EXPECT_EQ(d.fate(result.id).fate, Fate::kUnknown);
}

// The road is not heard from just after it has a message until after its deadline.
void silence_after_delivery(Door& d) {
  d.pipe.drop = [&d](std::size_t from, LinkId, ByteView) {
    return from == d.road && !d.came.empty() && d.pipe.now() < d.came[0].at + 300ms;
  };
  const SendResult result = d.send({Bytes(20'000)}, {.deadline = 100ms});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(50ms);
  ASSERT_EQ(d.came.size(), 1U);
}

TEST(Truth, WhatWasDeliveredIsNotDroppedThoughAllThatTellsOfItIsLost) {
  Door d;
  silence_after_delivery(d);
  for (int i = 0; i < 40; ++i) {
    d.send({Bytes(100)});
    d.pipe.run(10ms);
  }
  d.pipe.run(1s);
  EXPECT_NE(d.fates[SendId{1}][0].what.fate, Fate::kDropped);
}

TEST(Truth, NorWhereALinkIsUnpluggedOrTheClockOfThePeerJumps) {
  for (const bool jumps : {false, true}) {
    for (const Duration by : {Duration(10min), Duration(-10min)}) {
      Door d;
      silence_after_delivery(d);
      if (jumps) {
        d.pipe.jump(d.road, by);
      } else {
        d.pipe.at(d.vehicle).remove_link(d.pipe.local(d.vehicle), kFast);
        d.pipe.flush(d.vehicle);
      }
      for (int i = 0; i < 40; ++i) {
        d.send({Bytes(100)});
        d.pipe.run(10ms);
      }
      d.pipe.run(1s);
      ASSERT_EQ(d.fates[SendId{1}].size(), 1U);
      EXPECT_NE(d.fates[SendId{1}][0].what.fate, Fate::kDropped) << jumps;
    }
  }
}

// A report that left before a message had come says nothing of its deadline, whatever the peer's
// clock makes of the instant.
TEST(Truth, AReportFromBeforeTheDeadlineDropsNothingWhenTheClockOfThePeerJumps) {
  for (const Duration by : {Duration(30ms), Duration(1s), Duration(10min), Duration(5h)}) {
    for (int step = 0; step < 10; ++step) {
      Door d;
      d.pipe.run(step * 5ms);
      d.pipe.delay = {{kFast, 70ms}, {kSlow, 70ms}};
      const SendResult result = d.send({Bytes(100)});
      ASSERT_TRUE(result.accepted());
      d.pipe.run(45ms);
      d.pipe.jump(d.road, by);
      d.pipe.run(2s);
      ASSERT_EQ(d.fates[result.id].size(), 1U);
      EXPECT_TRUE(d.came.empty() || d.fates[result.id][0].what.fate != Fate::kDropped) << step;
    }
  }
}

// A piece never arrives, and no symbol that could stand for it. So many packets follow that no
// acknowledgement tells of the piece any more when its deadline comes: the receiver says that it
// has waited for it in vain.
TEST(Truth, WhatIsIncompleteIsDroppedHoweverManyPacketsFollow) {
  Door d;
  std::optional<std::uint32_t> first;
  d.pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    const auto packet = wire::parse(bytes);
    if (from != d.vehicle || !packet || packet->header.type != wire::PacketType::kData)
      return false;
    const wire::FragmentHeader& piece = packet->data.fragment;
    if (piece.size > 10'000 && !first) first = piece.message.value;
    return first == piece.message.value && (piece.index == 2 || piece.is_repair());
  };
  const SendResult result = d.send({Bytes(20'000)}, {.deadline = 100ms});
  ASSERT_TRUE(result.accepted());
  for (int i = 0; i < 100; ++i) {
    for (int j = 0; j < 10; ++j) d.send({Bytes(100)});
    d.pipe.run(2ms);
  }
  d.pipe.run(1s);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(result.id).reason, FateReason::kExpired);
  EXPECT_EQ(d.came.size(), d.fates.size() - 1);
}

TEST(Truth, ManySmallMessagesAtOnceAreAllToldOf) {
  Door d;
  SendOptions options{.deadline = 1s};
  for (int i = 0; i < 150; ++i) ASSERT_TRUE(d.send({Bytes(100)}, options).accepted());
  d.pipe.run(2s);
  EXPECT_EQ(d.came.size(), 150U);
  for (const auto& [id, told] : d.fates) {
    ASSERT_EQ(told.size(), 1U);
    EXPECT_EQ(told[0].what.fate, Fate::kDelivered);
  }
}

TEST(Truth, WhatWasLostIsDroppedWhileAnotherLinkIsDark) {
  Door d;
  d.pipe.drop = [&d](std::size_t from, LinkId link, ByteView bytes) {
    return link == kSlow || (from == d.vehicle && bytes.size() > 1'000);
  };
  d.pipe.run(5s);
  SendOptions options{.deadline = 100ms};
  const SendResult result = d.send({Bytes(20'000)}, options);
  ASSERT_TRUE(result.accepted());
  for (int i = 0; i < 40; ++i) {
    options.deadline = 50ms;
    d.send({Bytes(100)}, options);
    d.pipe.run(5ms);
  }
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(result.id).reason, FateReason::kExpired);
}

// What many messages to others lie between must not look old to a peer.
TEST(Truth, MessagesToOthersMakeNoneOld) {
  Pipe pipe;
  pipe.add_host(options_of(1, {}, false));
  std::vector<PeerId> peers;
  for (const std::uint32_t session : {2U, 3U}) {
    peers.push_back(pipe.connect(0, pipe.add_host(options_of(session))));
  }
  std::vector<std::size_t> came;
  std::map<Fate, int> fates;
  pipe.on_event = [&](std::size_t host, Event& e) {
    if (const auto* m = std::get_if<Message>(&e); m != nullptr && host == 1) {
      came.push_back(m->bytes.size());
    }
    if (const auto* fate = std::get_if<MessageFate>(&e)) ++fates[fate->fate];
  };
  pipe.run(3s);
  bool blocked = true;
  pipe.spins_allowed = 3;
  pipe.drop = [&blocked](std::size_t from, LinkId, ByteView bytes) {
    const auto packet = wire::parse(bytes);
    return blocked && from == 0 && packet && packet->data.fragment.size > 1'000;
  };
  SendOptions options{.deadline = 20s};
  const auto send = [&](std::size_t peer, std::size_t bytes) {
    EXPECT_TRUE(pipe.at(0).send(pipe.local(0), peers[peer], {Bytes(bytes)}, options).accepted());
    pipe.flush(0);
  };
  send(0, 1'200);
  for (int i = 0; i < 5'000; ++i) {
    send(1, 1);
    if (i % 10 == 0) pipe.run(1ms);
  }
  send(0, 10);
  pipe.run(100ms);
  EXPECT_EQ(came, std::vector<std::size_t>{10});
  blocked = false;
  pipe.run(20s);
  EXPECT_EQ(came, (std::vector<std::size_t>{10, 1'200}));
  EXPECT_EQ(fates[Fate::kDelivered], 5'002);
}

}  // namespace
}  // namespace interneuron::truth_test
