// One admitted vehicle that attacks harms nobody else: each honest round is served, and whatever
// the attacker fills is its own.
#include "insider.h"

namespace interneuron::insider_test {
namespace {

constexpr std::uint32_t kLongestDeadlineUs = UINT32_MAX;

TEST_F(Insider, IsServedWhileItBehaves) {
  rounds(20, [&](int i) { attacker.send(attacker.round(static_cast<std::uint32_t>(i))); });
  expect_unharmed();
  EXPECT_EQ(attackers().struck(PeerLimit::kContexts), 0U);
  EXPECT_TRUE(limited.empty());
}

// Rounds of 71 minutes, far more than there is room for at any endpoint.
TEST_F(Insider, ContextsOfItsOwnMakeRoomForTheNext) {
  serves_attacker = false;
  rounds(40, [&](int i) {
    for (std::uint32_t n = 0; n < 60; ++n) {
      auto header = attacker.round(static_cast<std::uint32_t>(i) * 60 + n);
      header.deadline_us = kLongestDeadlineUs;
      attacker.send(header);
    }
  });
  expect_unharmed();
  EXPECT_EQ(attackers().contexts, PeerLimits{}.contexts);
  EXPECT_EQ(attackers().struck(PeerLimit::kContexts), 40U * 60 - PeerLimits{}.contexts);
  EXPECT_EQ(attackers().struck(PeerLimit::kDeadline), 40U * 60);
  // Told once a second, for the five seconds that it took.
  EXPECT_GE(limited.size(), 4U);
  EXPECT_LE(limited.size(), 6U);
  for (const PeerLimited& told : limited) EXPECT_EQ(told.peer, attacker_at_road);
}

// What is kept of its rounds goes after twice the longest deadline that is believed.
TEST_F(Insider, DeadlinesAreBelievedUpToALimit) {
  serves_attacker = false;
  Duration told{};
  const auto note = pipe.on_event;
  pipe.on_event = [&](std::size_t host, Event& event) {
    if (const auto* d = std::get_if<Delivered>(&event)) told = d->deadline;
    note(host, event);
  };
  auto header = attacker.round(1);
  header.deadline_us = kLongestDeadlineUs;
  attacker.send(header);
  EXPECT_EQ(told, PeerLimits{}.longest_deadline);
  EXPECT_EQ(attackers().contexts, 1U);
  // It says something now and then, so that it is not forgotten itself.
  for (int second = 0; second < 21; ++second) {
    pipe.run(1s);
    attacker.probe(100);
  }
  attacker.send(attacker.round(2));
  EXPECT_EQ(attackers().contexts, 1U);
}

TEST_F(Insider, OldestContextsGoFirstWhateverTheyAreCalled) {
  serves_attacker = false;
  const std::size_t most = PeerLimits{}.contexts;
  // Numbers that fall, so that the newest one is the smallest.
  for (std::uint32_t n = 0; n <= most; ++n) {
    auto header = attacker.round(1000 - n);
    // A straggler of a round that is too old to be remembered would be dropped.
    header.round.pipeline = PipelineId{static_cast<std::uint8_t>(n / 32)};
    attacker.send(header);
  }
  const auto submit = [&](std::uint32_t n) {
    const RoundRef round{SessionId{kAttacker}, PipelineId{static_cast<std::uint8_t>(n / 32)},
                         RoundId{1000 - n}};
    return pipe.submit(road, round, 10);
  };
  EXPECT_EQ(submit(0), SubmitStatus::kRoundOver);
  EXPECT_EQ(submit(1), SubmitStatus::kAccepted);
  EXPECT_EQ(submit(static_cast<std::uint32_t>(most)), SubmitStatus::kAccepted);
}

// In the honest vehicle's name, with rounds that are yet to come.
TEST_F(Insider, RoundsOfOthersAreForeign) {
  rounds(20, [&](int i) {
    for (std::uint32_t n = 0; n < 64; ++n) {
      auto header = attacker.round(static_cast<std::uint32_t>(i) + n);
      header.round.origin = SessionId{kHonest};
      attacker.send(header);
    }
  });
  expect_unharmed();
  EXPECT_EQ(pipe.at(road).counters().foreign_rounds, 20U * 64);
  EXPECT_EQ(attackers().struck(PeerLimit::kOrigin), 20U * 64);
  EXPECT_EQ(attackers().contexts, 0U);
}

TEST_F(Insider, PipelinesOfItsOwnMakeRoomForTheNext) {
  rounds(20, [&](int) {
    for (int n = 0; n < 256; ++n) {
      auto header = attacker.round(1);
      header.round.pipeline = PipelineId{static_cast<std::uint8_t>(n)};
      attacker.send(header);
    }
  });
  expect_unharmed();
  EXPECT_EQ(attackers().pipelines, PeerLimits{}.pipelines);
  EXPECT_GT(attackers().struck(PeerLimit::kPipelines), 0U);
}

// Down-sampled variants that wait for raw ones which never come.
TEST_F(Insider, MessagesThatWaitFindRoomOnlyForAFew) {
  serves_attacker = false;
  std::size_t most = 0;
  rounds(20, [&](int i) {
    for (std::uint32_t n = 0; n < 60; ++n) {
      auto header = attacker.round(static_cast<std::uint32_t>(i) * 60 + n);
      header.deadline_us = kLongestDeadlineUs;
      header.variant = 1;
      attacker.send(header, 1000);
    }
    most = std::max(most, attackers().held_messages);
  });
  expect_unharmed();
  EXPECT_EQ(most, PeerLimits{}.held_messages);
  EXPECT_GT(attackers().struck(PeerLimit::kHeldMessages), 0U);
}

TEST_F(Insider, ToleranceAndNumbersMayBeAnything) {
  rounds(20, [&](int i) {
    auto header = attacker.round(UINT32_MAX - static_cast<std::uint32_t>(i));
    header.x_permille = INT16_MAX;
    header.t0 = PeerTime{Duration{i % 2 == 0 ? INT64_MAX : INT64_MIN}};
    header.guard = i % 3 == 0 ? GuardKind::kBudget : GuardKind::kPaper;
    header.e2e.fill(UINT16_MAX);
    attacker.send(header);
    // The honest vehicle names no such peer: its own packets have numbers of their own.
    attacker.number = UINT64_MAX - 1000 + static_cast<std::uint64_t>(i) * 10;
  });
  expect_unharmed();
}

// Messages of 8 MB for 71 minutes of which one small piece comes.
TEST_F(Insider, ClaimsCostWhatHasArrived) {
  std::size_t most = 0;
  rounds(20, [&](int) {
    for (int n = 0; n < 100; ++n) {
      wire::FragmentHeader claim{attacker.next_message(), 0, 1300, kMaxMessageBytes, UINT32_MAX};
      claim.index = static_cast<std::uint16_t>(claim.count() - 1);
      attacker.piece(claim, Bytes(claim.bytes()));
    }
    most = std::max(most, pipe.at(road).reassembly_bytes());
  });
  expect_unharmed();
  EXPECT_LE(most, 4U * 1024 * 1024);
  EXPECT_LE(attackers().reassembly_messages, PeerLimits{}.reassembly_messages);
  EXPECT_EQ(attackers().longest_lifetime, PeerLimits{}.longest_deadline);
  EXPECT_GT(attackers().struck(PeerLimit::kReassembly), 0U);
  // Nobody follows them up.
  for (int second = 0; second < 11; ++second) {
    pipe.run(1s);
    attacker.probe(100);
  }
  EXPECT_EQ(attackers().reassembly_bytes, 0U);
}

// As much as it can, of many messages at once, and none of them whole.
TEST_F(Insider, IncompleteMessagesFillItsOwnPart) {
  std::vector<MessageId> open;
  for (int n = 0; n < 20; ++n) open.push_back(attacker.next_message());
  std::uint16_t index = 0;
  rounds(20, [&](int) {
    for (const std::uint16_t end = index + 50; index < end; ++index) {
      for (const MessageId id : open) {
        attacker.piece({id, index, 1300, kMaxMessageBytes, UINT32_MAX}, Bytes(1300));
      }
    }
    EXPECT_LE(attackers().reassembly_bytes, PeerLimits{}.reassembly_bytes);
  });
  expect_unharmed();
  EXPECT_GE(attackers().reassembly_bytes, PeerLimits{}.reassembly_bytes / 2);
}

TEST_F(Insider, PacketsOfUnknownTypesAreCounted) {
  rounds(20, [&](int) {
    for (int type = 7; type < 16; ++type) {
      std::array<std::byte, kMaxDatagramBytes> out;
      const std::size_t size =
          wire::write_probe(out, attacker.header(wire::PacketType::kProbe), 100);
      out[0] = static_cast<std::byte>((std::to_integer<int>(out[0]) & 0xf0) | type);
      attacker.feed(std::span(out).first(size));
    }
  });
  expect_unharmed();
}

// What an attacker holds goes with it.
TEST_F(Insider, IsForgottenWithAllItHolds) {
  serves_attacker = false;
  for (std::uint32_t n = 0; n < 100; ++n) {
    auto header = attacker.round(n);
    header.deadline_us = kLongestDeadlineUs;
    header.variant = n % 2 == 0 ? 1 : 0;
    attacker.send(header);
  }
  EXPECT_GT(attackers().contexts, 0U);
  pipe.run(70s);
  EXPECT_EQ(attackers().contexts, 0U);
  EXPECT_EQ(attackers().pipelines, 0U);
  EXPECT_EQ(attackers().held_messages, 0U);
  rounds(5, [](int) {});
  expect_unharmed();
}

// --- sizes and rates

class Restricted : public Insider {
 protected:
  static EndpointOptions options() {
    EndpointOptions out = options_of(kRoad);
    out.peer_limits.plain_bytes = 300;
    out.peer_limits.channel_bytes = {{7, 1000}, {8, 10}};
    out.peer_limits.round_bytes = 100'000;
    out.peer_limits.packets_per_second = 2000;
    out.peer_limits.messages_per_second = 400;
    return out;
  }
  Restricted() : Insider(options()) {}
  std::uint64_t delivered() { return pipe.at(road).counters().messages_completed; }
};

TEST_F(Restricted, MessagesAreAsLargeAsTheirChannelAllows) {
  attacker.send_plain(1, 300);
  attacker.send_plain(7, 1000);
  attacker.send_plain(8, 10);
  EXPECT_EQ(delivered(), 3U);
  attacker.send_plain(1, 301);
  attacker.send_plain(7, 1001);
  attacker.send_plain(8, 11);
  attacker.piece({attacker.next_message(), 0, 1000, 200'000, 1000}, Bytes(1000));
  EXPECT_EQ(delivered(), 3U);
  EXPECT_EQ(attackers().struck(PeerLimit::kMessageSize), 4U);
  EXPECT_EQ(attackers().reassembly_bytes, 0U);
}

TEST_F(Restricted, PacketsBeyondTheRateAreDroppedUnread) {
  const auto refused = [this] { return pipe.at(road).link_counters(kFast).refused_packets; };
  const std::uint64_t before = refused();
  rounds(10, [&](int) {
    for (int n = 0; n < 1000; ++n) attacker.probe(100);
  });
  expect_unharmed();
  const std::uint64_t dropped = attackers().struck(PeerLimit::kPacketRate);
  EXPECT_NEAR(static_cast<double>(dropped), 10'000 - 500 - 0.9 * 2000, 20);
  EXPECT_EQ(refused() - before, dropped);
  ASSERT_FALSE(limited.empty());
  EXPECT_EQ(limited.front().limit, PeerLimit::kPacketRate);
}

TEST_F(Restricted, MessagesBeyondTheRateAreDropped) {
  serves_attacker = false;
  rounds(10, [&](int i) {
    for (std::uint32_t n = 0; n < 100; ++n) {
      attacker.send(attacker.round(static_cast<std::uint32_t>(i) * 100 + n));
    }
  });
  expect_unharmed();
  EXPECT_NEAR(static_cast<double>(attackers().struck(PeerLimit::kMessageRate)),
              1000 - 100 - 0.9 * 400, 10);
}

// --- relays

class Relayed : public Insider {
 protected:
  static EndpointOptions options() {
    EndpointOptions out = options_of(kRoad);
    out.relays = {address_of(2)};
    return out;
  }
  Relayed() : Insider(options()) {}
};

TEST_F(Relayed, RoundsOfOthersAreServedFromARelay) {
  auto header = attacker.round(1);
  header.round.origin = SessionId{77};
  attacker.send(header);
  EXPECT_EQ(pipe.at(road).counters().foreign_rounds, 0U);
  EXPECT_EQ(attackers().contexts, 1U);
}

// A relay brings what the honest vehicle sends itself: who began the round comes first.
TEST_F(Relayed, ItsCopyGivesWayToTheOrigin) {
  rounds(10, [&](int i) {
    auto header = attacker.round(static_cast<std::uint32_t>(i));
    header.round.origin = SessionId{kHonest};
    attacker.send(header);
  });
  EXPECT_EQ(remote, begun);
}

}  // namespace
}  // namespace interneuron::insider_test
