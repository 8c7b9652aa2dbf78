// When packets are reported, and what becomes of a report that may not leave.
#include "core/peers/feedback_due.h"

#include <gtest/gtest.h>

#include <array>

#include "pipe.h"

namespace interneuron {
namespace {

TimePoint at(Duration d) { return TimePoint{1s + d}; }

TEST(FeedbackDue, AfterFiveMillisecondsOrSixteenPackets) {
  FeedbackDue due(at(0s));
  EXPECT_FALSE(due.at());
  due.arrived(at(0s), false);
  EXPECT_EQ(due.at(), at(5ms));
  for (int i = 1; i < 15; ++i) due.arrived(at(1ms), false);
  EXPECT_EQ(due.at(), at(5ms));
  due.arrived(at(2ms), false);
  EXPECT_TRUE(due.is_due(at(2ms)));
  due.sent(at(2ms));
  EXPECT_FALSE(due.at());
  due.arrived(at(3ms), false);
  EXPECT_EQ(due.at(), at(8ms));
}

TEST(FeedbackDue, AGapAtOnceButNotTwiceInAMillisecond) {
  FeedbackDue due(at(0s));
  due.arrived(at(10ms), true);
  EXPECT_TRUE(due.is_due(at(10ms)));
  due.sent(at(10ms));
  due.arrived(at(10ms + 200us), true);
  EXPECT_EQ(due.at(), at(11ms));
}

// One feedback for a burst of a fast link, and not one for every 16 packets of it.
TEST(FeedbackDue, WaitsForTheRestOfABurst) {
  FeedbackDue due(at(0s));
  for (int i = 0; i < 127; ++i) due.arrived(at(i * 6us), false);
  EXPECT_EQ(due.at(), at(1ms));
  due.arrived(at(127 * 6us), false);
  EXPECT_TRUE(due.is_due(at(127 * 6us))) << "half of what one feedback can tell of";
}

TEST(FeedbackDue, AtOnceWhenABurstCompletesAMessage) {
  FeedbackDue due(at(0s));
  for (int i = 0; i < 15; ++i) due.arrived(at(0s), false);
  due.completed(at(0s));
  EXPECT_EQ(due.at(), at(5ms)) << "messages of few packets may be many";
  due.arrived(at(0s), false);
  due.completed(at(0s));
  EXPECT_TRUE(due.is_due(at(0s)));
}

// The smallest packet that is served: three of them pay for a feedback to an address that is not
// trusted yet, and one does not.
TEST(FeedbackDue, StaysDueWhileTheAddressMayNotGetIt) {
  Endpoint road(options_of(2), at(0s));
  road.add_link(at(0s), kFast, {"nic", 1500});
  std::array<std::byte, kMaxDatagramBytes> out;
  const auto hear = [&](TimePoint now, std::uint64_t number) {
    std::array<std::byte, wire::kPacketOverhead> packet;
    wire::write_probe(packet,
                      {wire::PacketType::kProbe, kFast, wire::kClearEpoch, SessionId{1}, number, 0},
                      packet.size());
    road.handle_datagram(now, {kFast, address_of(0), packet});
  };
  const auto sent = [&](TimePoint now) {
    road.handle_timeout(now);
    std::optional<wire::Packet> packet;
    while (const auto t = road.poll_transmit(now, out)) {
      packet = wire::parse(std::span(out).first(t->size));
    }
    return packet;
  };
  constexpr std::size_t kNeeded =
      (wire::feedback_bytes(1) + 3 * wire::kPacketOverhead - 1) / (3 * wire::kPacketOverhead);
  ASSERT_GT(kNeeded, 1U);
  for (std::uint64_t n = 1; n < kNeeded; ++n) hear(at(0s), n);
  EXPECT_FALSE(sent(at(0s)));
  EXPECT_FALSE(sent(at(6ms)));
  // It is due, and waits for nothing that time brings.
  EXPECT_GT(*road.next_timeout(), at(6ms));
  hear(at(7ms), kNeeded);
  const auto feedback = sent(at(7ms));
  ASSERT_TRUE(feedback);
  EXPECT_EQ(feedback->feedback.reports[0].largest, kNeeded);
}

}  // namespace
}  // namespace interneuron
