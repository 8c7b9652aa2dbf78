// A plain message from send() to its fate and to the application at the other end.
#include <gtest/gtest.h>

#include "core/wire/plain_header.h"
#include "door.h"

namespace interneuron::send_test {
namespace {

TEST(Send, AMessageIsDeliveredWithItsAgeAndSoIsItsFate) {
  Door d;
  const SendResult result = d.send({Bytes(5'000, std::byte{3})}, {.channel = 7, .importance = 200});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(100ms);
  ASSERT_EQ(d.came.size(), 1U);
  const Message& m = d.came[0].what;
  EXPECT_EQ(m.peer, d.back);
  EXPECT_EQ(m.channel, 7);
  EXPECT_EQ(m.importance, 200);
  EXPECT_EQ(m.variant, 0);
  EXPECT_EQ(m.bytes, Bytes(5'000, std::byte{3}));
  const Duration took = d.came[0].at - d.sent[result.id].at;
  ASSERT_TRUE(m.age);
  EXPECT_NEAR(to_ms(*m.age), to_ms(took), to_ms(m.age_error));
  EXPECT_LE(m.age_error, 10ms);
  const MessageFate fate = d.fate(result.id);
  EXPECT_EQ(fate.fate, Fate::kDelivered);
  EXPECT_EQ(fate.reason, FateReason::kNone);
  EXPECT_EQ(fate.channel, 7);
  EXPECT_EQ(fate.peer, d.peer);
  EXPECT_NEAR(to_ms(fate.age), to_ms(took), to_ms(fate.age_error) + 0.01);
}

TEST(Send, WorksBothWaysAndFromOneByteToTheLargest) {
  Door d;
  for (const std::size_t bytes : {std::size_t{1}, std::size_t{1'327}, std::size_t{1'328},
                                  std::size_t{100'000}, kMaxMessageBytes}) {
    d.came.clear();
    const SendResult result = d.send({Bytes(bytes)}, {.deadline = 20s});
    ASSERT_TRUE(result.accepted()) << bytes << " " << to_string(result.status);
    d.pipe.run(20s);
    ASSERT_EQ(d.came.size(), 1U) << bytes;
    EXPECT_EQ(d.came[0].what.bytes.size(), bytes);
    EXPECT_EQ(d.fate(result.id).fate, Fate::kDelivered);
  }
  std::vector<Message> at_vehicle;
  d.pipe.on_event = [&](std::size_t host, Event& e) {
    if (auto* m = std::get_if<Message>(&e); m != nullptr && host == d.vehicle) {
      at_vehicle.push_back(*m);
    }
  };
  const auto answer =
      d.pipe.at(d.road).send(d.pipe.local(d.road), d.back, {Bytes(100)}, SendOptions{});
  d.pipe.flush(d.road);
  EXPECT_TRUE(answer.accepted());
  d.pipe.run(100ms);
  EXPECT_EQ(at_vehicle.size(), 1U);
}

TEST(Send, OfTheVariantsTheFirstThatIsThereIsDelivered) {
  Door d;
  SendOptions options{.policy = "duplicate"};
  const SendResult result = d.send({Bytes(60'000), Bytes(1'000)}, options);
  ASSERT_TRUE(result.accepted());
  d.pipe.run(500ms);
  EXPECT_EQ(d.came.size(), 1U);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.fate(result.id).variant, d.came[0].what.variant);
}

TEST(Send, AMessageThatIsLateIsNotDeliveredAndItsFateSaysSo) {
  Door d;
  // What the vehicle sends takes longer than the links ever showed.
  for (const LinkId link : {kFast, kSlow}) d.pipe.extra_from_0[link] = 60ms;
  SendOptions options{.deadline = 50ms};
  const SendResult result = d.send({Bytes(100)}, options);
  ASSERT_TRUE(result.accepted());
  d.pipe.run(1s);
  EXPECT_TRUE(d.came.empty());
  const MessageFate fate = d.fate(result.id);
  EXPECT_EQ(fate.fate, Fate::kLate);
  EXPECT_GT(fate.age, options.deadline);
  EXPECT_EQ(d.pipe.at(d.road).counters().messages_late, 1U);
}

TEST(Send, OverLinksThatAreCutTheFateIsUnknownARoundTripAnd50MsAfterTheDeadline) {
  Door d;
  d.pipe.cut = {kFast, kSlow};
  const SendResult result = d.send({Bytes(100)});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(1s);
  const MessageFate fate = d.fate(result.id);
  EXPECT_EQ(fate.fate, Fate::kUnknown);
  const Duration after = d.fates[result.id][0].at - d.sent[result.id].at - 100ms;
  EXPECT_GE(after, 50ms);
  EXPECT_LE(after, 50ms + 20ms + 1ms);
}

TEST(Send, WhatAPeerSaysIsIncompleteAtTheDeadlineIsDropped) {
  Door d;
  // Pieces are lost, while small packets pass.
  d.pipe.drop = [&d](std::size_t from, LinkId, ByteView bytes) {
    return from == d.vehicle && bytes.size() > 1'000;
  };
  SendOptions options{.deadline = 300ms};
  const SendResult result = d.send({Bytes(20'000)}, options);
  ASSERT_TRUE(result.accepted());
  std::size_t small = 0;
  options.deadline = 30ms;
  for (int i = 0; i < 80; ++i) {
    small += d.send({Bytes(100)}, options).accepted() ? 1 : 0;
    d.pipe.run(5ms);
  }
  EXPECT_GT(small, 50U);
  const MessageFate fate = d.fate(result.id);
  EXPECT_EQ(fate.fate, Fate::kDropped);
  EXPECT_EQ(fate.reason, FateReason::kExpired);
  for (const Door::Came& c : d.came) EXPECT_EQ(c.what.bytes.size(), 100U);
}

TEST(Send, ACancelledMessageIsDroppedAtOnce) {
  Door d;
  const SendResult result = d.send({Bytes(1'000'000)}, {.deadline = 5s});
  ASSERT_TRUE(result.accepted());
  EXPECT_TRUE(d.pipe.at(d.vehicle).cancel(d.pipe.local(d.vehicle), result.id));
  EXPECT_FALSE(d.pipe.at(d.vehicle).cancel(d.pipe.local(d.vehicle), result.id));
  d.pipe.flush(d.vehicle);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(result.id).reason, FateReason::kCancelled);
  d.pipe.run(10s);
  EXPECT_TRUE(d.came.empty());
  EXPECT_FALSE(d.pipe.at(d.vehicle).cancel(d.pipe.local(d.vehicle), SendId{99}));
}

TEST(Send, ANewerMessageOfTheChannelTakesThePlaceOfOneThatHasNotLeft) {
  Door d;
  SendOptions options{.deadline = 5s, .newest_only = true};
  const SendResult first = d.send({Bytes(2'000'000)}, options);
  options.channel = 1;
  const SendResult other = d.send({Bytes(1'000)}, options);
  options.channel = 0;
  const SendResult second = d.send({Bytes(1'000)}, options);
  ASSERT_TRUE(first.accepted() && other.accepted() && second.accepted());
  d.pipe.run(6s);
  EXPECT_EQ(d.fate(first.id).reason, FateReason::kSuperseded);
  EXPECT_EQ(d.fate(other.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.fate(second.id).fate, Fate::kDelivered);
  EXPECT_EQ(d.came.size(), 2U);
}

TEST(Send, ARestartOfThePeerLeavesTheFateUnknown) {
  Door d;
  SendOptions options{.deadline = 30s};
  d.pipe.cut = {kFast, kSlow};
  const SendResult result = d.send({Bytes(1'000)}, options);
  ASSERT_TRUE(result.accepted());
  d.pipe.restart(d.road, options_of(22));
  d.pipe.cut.clear();
  d.pipe.run(10s);
  const MessageFate fate = d.fate(result.id);
  if (fate.fate != Fate::kDelivered) {
    EXPECT_EQ(fate.fate, Fate::kUnknown);
    EXPECT_EQ(fate.reason, FateReason::kPeerGone);
  }
  const SendResult again = d.send({Bytes(1'000)});
  EXPECT_TRUE(again.accepted());
  d.pipe.run(1s);
  EXPECT_EQ(d.fate(again.id).fate, Fate::kDelivered);
}

TEST(Send, AJumpOfThePeersClockMakesMessagesLateUntilItIsNoticed) {
  Door d;
  d.pipe.jump(d.road, 10min);
  const SendResult result = d.send({Bytes(100)});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(5s);
  EXPECT_NE(d.fate(result.id).fate, Fate::kUnknown);
  const SendResult again = d.send({Bytes(100)});
  ASSERT_TRUE(again.accepted());
  d.pipe.run(1s);
  EXPECT_EQ(d.fate(again.id).fate, Fate::kDelivered);
}

TEST(Send, AMalformedHeaderIsCounted) {
  Door d;
  wire::FragmentHeader fragment{MessageId{900'000}, 0, 30, 30, 1'000};
  fragment.kind = wire::MessageKind::kPlain;
  std::array<std::byte, kMaxDatagramBytes> out;
  const wire::PacketHeader header{wire::PacketType::kData, kFast, wire::kClearEpoch, SessionId{1},
                                  100'000'000};
  const std::size_t size = wire::write_data(out, header, fragment, Bytes(30));
  d.pipe.at(d.road).handle_datagram(d.pipe.local(d.road),
                                    {kFast, address_of(0), std::span(out).first(size)});
  EXPECT_EQ(d.pipe.at(d.road).counters().bad_messages, 1U);
}

TEST(Send, APieceThatContradictsOthersIsCountedAndItsMessageDelivered) {
  Door d;
  std::vector<Pipe::Captured> sent;
  d.pipe.capture = &sent;
  const SendResult result = d.send({Bytes(200'000)});
  ASSERT_TRUE(result.accepted());
  d.pipe.run(12ms);
  std::erase_if(sent, [](const Pipe::Captured& c) { return c.from != 0 || !c.is_data(); });
  ASSERT_FALSE(sent.empty());
  auto packet = *wire::parse(sent.back().bytes);
  wire::FragmentHeader forged = packet.data.fragment;
  forged.size += 1;
  forged.index = 0;
  packet.header.number += 200;
  std::array<std::byte, kMaxDatagramBytes> out;
  const std::size_t size = wire::write_data(out, packet.header, forged, Bytes(forged.chunk));
  d.pipe.at(d.road).handle_datagram(d.pipe.local(d.road),
                                    {sent.back().link, address_of(0), std::span(out).first(size)});
  d.pipe.run(1s);
  EXPECT_EQ(d.pipe.at(d.road).counters().bad_fragments, 1U);
  EXPECT_EQ(d.pipe.at(d.road).counters().reassembly_refused, 0U);
  EXPECT_EQ(d.fate(result.id).fate, Fate::kDelivered);
}

}  // namespace
}  // namespace interneuron::send_test
