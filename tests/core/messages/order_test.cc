// Messages of an ordered channel are handed over in their order, and none waits beyond its bound.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>

#include "core/wire/plain_header.h"
#include "door.h"

namespace interneuron::order_test {
namespace {

constexpr Duration kBound = 40ms;

struct Order : ::testing::Test {
  Door d;
  // Which messages arrive late, by their number (the first byte), and by how much.
  std::map<int, Duration> late;
  SendOptions options{.deadline = 500ms, .policy = "best_link", .channel = 3};

  Order() {
    options.in_order_within = kBound;
    d.pipe.spins_allowed = 3;
    d.pipe.drop = [this](std::size_t from, LinkId, ByteView bytes) {
      extra_ = 0ms;
      const auto packet = wire::parse(bytes);
      if (from != d.vehicle || !packet || packet->header.type != wire::PacketType::kData) {
        return false;
      }
      const auto header = wire::parse_plain_header(packet->data.bytes);
      if (!header) return false;
      const int number = std::to_integer<int>(packet->data.bytes[header->bytes()]);
      if (late.contains(number)) extra_ = late.at(number);
      return extra_ == Duration::max();
    };
    d.pipe.jitter = [this] { return extra_; };
  }
  SendResult send(int number) { return d.send({Bytes(100, std::byte(number))}, options); }
  std::vector<int> came() const {
    std::vector<int> numbers;
    for (const Door::Came& c : d.came) numbers.push_back(std::to_integer<int>(c.what.bytes[0]));
    return numbers;
  }

 private:
  Duration extra_{};
};

TEST_F(Order, WhatIsThereFirstWaitsForWhatIsBeforeIt) {
  late[1] = 30ms;
  for (int i = 0; i < 4; ++i) {
    send(i);
    d.pipe.run(1ms);
  }
  d.pipe.run(20ms);
  EXPECT_EQ(came(), (std::vector{0}));
  EXPECT_EQ(d.pipe.at(d.road).ledger(d.back).held_messages, 2U);
  d.pipe.run(100ms);
  EXPECT_EQ(came(), (std::vector{0, 1, 2, 3}));
  EXPECT_EQ(d.pipe.at(d.road).ledger(d.back).held_messages, 0U);
}

TEST_F(Order, ButNotBeyondItsBoundAndWhatComesThenIsDropped) {
  late[1] = 100ms;
  std::vector<SendResult> sent;
  for (int i = 0; i < 4; ++i) {
    sent.push_back(send(i));
    d.pipe.run(1ms);
  }
  d.pipe.run(1s);
  EXPECT_EQ(came(), (std::vector{0, 2, 3}));
  EXPECT_EQ(d.fate(sent[1].id).fate, Fate::kDropped);
  EXPECT_EQ(d.fate(sent[1].id).reason, FateReason::kSuperseded);
  EXPECT_NEAR(to_ms(d.came[1].at - d.sent[sent[2].id].at), to_ms(5ms + kBound), 0.1);
  EXPECT_NEAR(to_ms(d.came[2].at - d.came[1].at), 0, 0.1);
}

TEST_F(Order, NorBeyondItsDeadline) {
  late[1] = Duration::max();
  send(0);
  d.pipe.run(1ms);
  send(1);
  options.deadline = 30ms;
  const SendResult sent = send(2);
  d.pipe.run(25ms);
  EXPECT_EQ(came(), (std::vector{0}));
  d.pipe.run(1s);
  ASSERT_EQ(came(), (std::vector{0, 2}));
  EXPECT_LE(d.came[1].at - d.sent[sent.id].at, 30ms);
}

TEST_F(Order, OtherChannelsAndPlainMessagesDoNotWait) {
  late[1] = 30ms;
  send(0);
  d.pipe.run(1ms);
  send(1);
  options.channel = 4;
  send(2);
  options.channel = 3;
  options.in_order_within = 0ms;
  send(4);
  d.pipe.run(10ms);
  EXPECT_EQ(came(), (std::vector{0, 2, 4}));
}

TEST_F(Order, WhereTooManyWaitTheMissingOneIsPassedOver) {
  PeerLimits limits;
  limits.ordered_messages = 3;
  EndpointOptions road = options_of(2);
  road.peer_limits = limits;
  Door small(1h, std::move(road));
  bool first = true;
  small.pipe.drop = [&](std::size_t from, LinkId, ByteView bytes) {
    const auto packet = wire::parse(bytes);
    const bool is_data = packet && packet->header.type == wire::PacketType::kData;
    return from == 0 && is_data && packet->data.fragment.size > 500 && std::exchange(first, false);
  };
  options.in_order_within = 400ms;
  small.send({Bytes(50)}, options);
  small.pipe.run(1ms);
  small.send({Bytes(600)}, options);
  for (std::size_t i = 1; i <= 4; ++i) small.send({Bytes(i)}, options);
  small.pipe.run(9ms);
  ASSERT_EQ(small.came.size(), 5U);
  for (std::size_t i = 1; i <= 4; ++i) EXPECT_EQ(small.came[i].what.bytes.size(), i);
  EXPECT_EQ(small.pipe.at(small.road).ledger(small.back).struck(PeerLimit::kHeldMessages), 1U);
}

// Every twentieth packet 30 ms late, 1,000 messages a second.
TEST_F(Order, NothingIsOutOfOrderWhereEveryTwentiethIsLate) {
  for (const std::uint64_t seed : {70'051U, 70'052U}) {
    std::mt19937_64 random(seed);
    d.pipe.drop = nullptr;
    d.pipe.jitter = [&random] { return random() % 20 == 0 ? 30ms : 0ms; };
    d.came.clear();
    std::vector<SendId> ids;
    for (std::uint32_t i = 0; i < 3'000; ++i) {
      Bytes bytes(100);
      std::memcpy(bytes.data(), &i, sizeof i);
      ids.push_back(d.send({std::move(bytes)}, options).id);
      d.pipe.run(1ms);
    }
    d.pipe.run(1s);
    std::vector<std::uint32_t> numbers;
    for (const Door::Came& c : d.came) {
      std::uint32_t number = 0;
      std::memcpy(&number, c.what.bytes.data(), sizeof number);
      numbers.push_back(number);
      const Duration took = c.at - d.sent[ids[number]].at;
      EXPECT_LE(took, 10ms + 30ms + kBound);
    }
    EXPECT_EQ(numbers.size(), 3'000U);
    EXPECT_TRUE(std::ranges::is_sorted(numbers));
  }
}

}  // namespace
}  // namespace interneuron::order_test
