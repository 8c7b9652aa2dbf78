#include "core/flow/traffic.h"

#include <gtest/gtest.h>

#include "tests/counted_heap.h"

namespace interneuron::flow::message_store_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(MessageStore, TellsWhoseDeadlineIsNext) {
  MessageStore store;
  EXPECT_FALSE(store.next_deadline());
  store.add(MessageId{1}, at(3s), 1, 1);
  store.add(MessageId{2}, at(1s), 1, 1);
  store.add(MessageId{3}, at(2s), 1, 1);
  EXPECT_EQ(store.next_deadline(), at(1s));
  EXPECT_FALSE(store.due(at(1s) - 1ns));
  EXPECT_EQ(store.due(at(1s)), MessageId{2});
  store.erase(MessageId{2});
  EXPECT_EQ(store.next_deadline(), at(2s));
  store.erase(MessageId{3});
  store.erase(MessageId{3});
  EXPECT_EQ(store.due(at(5s)), MessageId{1});
  store.clear();
  EXPECT_EQ(store.find(MessageId{1}), nullptr);
  EXPECT_FALSE(store.next_deadline());
}

TEST(MessageStore, APlaceThatIsUsedAgainKnowsNothingOfBefore) {
  MessageStore store;
  OutgoingMessage& first = store.add(MessageId{1}, at(1s), 2000, 2);
  first.bytes.payload.resize(5);
  first.pieces[7].acknowledged = true;
  first.repairs.add(LinkId{3});
  first.round = RoundRef{};
  first.aim = at(3s);
  first.doubt = 1s;
  store.erase(MessageId{1});
  EXPECT_EQ(store.find(MessageId{1}), nullptr);
  const OutgoingMessage& second = store.add(MessageId{2}, at(2s), 8, 1);
  EXPECT_EQ(store.find(MessageId{2}), &second);
  EXPECT_TRUE(second.bytes.empty());
  EXPECT_FALSE(second.repairs.contains(LinkId{3}));
  EXPECT_FALSE(second.round);
  EXPECT_EQ(second.aim, TimePoint{});
  EXPECT_EQ(second.doubt, Duration{});
  ASSERT_EQ(second.pieces.size(), 8U);
  for (const auto& piece : second.pieces) {
    EXPECT_FALSE(piece.acknowledged);
    EXPECT_EQ(piece.under_way, 1);
  }
}

TEST(MessageStore, MoreMessagesCopyNone) {
  MessageStore store;
  std::vector<const std::byte*> before;
  for (std::uint32_t i = 0; i < 20; ++i) {
    OutgoingMessage& message = store.add(MessageId{i}, at(1s), 1, 1);
    message.bytes.payload.resize(1000);
    before.push_back(message.bytes.payload.data());
  }
  for (std::uint32_t i = 0; i < 20; ++i) {
    EXPECT_EQ(store.find(MessageId{i})->bytes.payload.data(), before[i]);
  }
}

// A free place keeps what common messages need, and nothing of a large one.
TEST(MessageStore, ALargeMessageLeavesNoMemoryBehind) {
  MessageStore store;
  store.add(MessageId{1}, at(1s), 1, 1);
  store.erase(MessageId{1});
  const std::int64_t before = held_bytes;
  OutgoingMessage& large = store.add(MessageId{2}, at(1s), 60'000, 1);
  large.symbols.resize(5000);
  store.erase(MessageId{2});
  EXPECT_LT(held_bytes - before, 1000);
}

}  // namespace
}  // namespace interneuron::flow::message_store_test
