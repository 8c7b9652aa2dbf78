#include "core/flow/job_queue.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>

namespace interneuron::flow::job_queue_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

TEST(JobQueue, OfEqualDeadlinesTheFirstThatWasAddedIsServed) {
  JobQueue queue;
  queue.add(MessageId{9}, {0, at(1s)}, 0, 1, 100);
  queue.add(MessageId{3}, {0, at(1s)}, 0, 1, 100);
  EXPECT_EQ(queue.first()->message, MessageId{9});
  queue.remove(MessageId{9});
  queue.add(MessageId{1}, {0, at(1s)}, 0, 1, 100);
  EXPECT_EQ(queue.first()->message, MessageId{3});
  EXPECT_EQ(queue.messages(), (std::vector{MessageId{3}, MessageId{1}}));
  queue.add(MessageId{5}, {0, at(500ms)}, 0, 1, 100);
  EXPECT_EQ(queue.first()->message, MessageId{5});
  EXPECT_EQ(queue.messages(), (std::vector{MessageId{3}, MessageId{1}, MessageId{5}}));
}

TEST(JobQueue, TheLowestRankIsServedFirstWhateverTheDeadlines) {
  JobQueue queue;
  queue.add(MessageId{1}, {2, at(1ms)}, 0, 1, 100);
  queue.add(MessageId{2}, {1, at(1s)}, 0, 1, 100);
  queue.add(MessageId{3}, {1, at(500ms)}, 0, 1, 100);
  EXPECT_EQ(queue.first()->message, MessageId{3});
  EXPECT_EQ(queue.bytes_before({1, at(600ms)}), 100U);
  EXPECT_EQ(queue.bytes_before({2, at(0ms)}), 200U);
}

TEST(JobQueue, WhatIsSentAgainGoesFirst) {
  JobQueue queue;
  Job& job = queue.add(MessageId{1}, {0, at(1s)}, 0, 4, 100);
  EXPECT_EQ(queue.take(job)->index, 0);
  queue.push_again(job, 0);
  EXPECT_TRUE(job.again.contains(0));
  EXPECT_EQ(queue.bytes(), 400U);
  const auto again = queue.take(job);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->index, 0);
  EXPECT_TRUE(again->is_again);
  EXPECT_FALSE(job.again.contains(0));
  EXPECT_EQ(queue.take_all(job), (std::vector<std::uint16_t>{1, 2, 3}));
  EXPECT_FALSE(queue.take(job));
  EXPECT_EQ(queue.bytes(), 0U);
  // A job stays until it is removed.
  EXPECT_EQ(queue.find(MessageId{1}), &job);
}

TEST(JobQueue, APlaceThatIsUsedAgainOwesNothingOfBefore) {
  JobQueue queue;
  queue.push_again(queue.add(MessageId{1}, {0, at(1s)}, 2000, 2000, 100), 1999);
  queue.remove(MessageId{1});
  EXPECT_EQ(queue.bytes(), 0U);
  EXPECT_EQ(queue.find(MessageId{1}), nullptr);
  Job& job = queue.add(MessageId{2}, {0, at(1s)}, 0, 2000, 10);
  EXPECT_FALSE(job.again.contains(1999));
  EXPECT_EQ(job.pieces(), 2000U);
}

// Beside a list that is searched from end to end.
RC_GTEST_PROP(JobQueue, DoesWhatAListDoes, ()) {
  struct Model {
    MessageId message{};
    JobQueue::Turn turn;
    std::size_t pieces = 0;
  };
  JobQueue queue;
  std::vector<Model> model;
  const int steps = *rc::gen::inRange(0, 300);
  for (int i = 0; i < steps; ++i) {
    const MessageId id{*rc::gen::inRange(0U, 24U)};
    const auto known = std::ranges::find(model, id, &Model::message);
    if (known == model.end()) {
      const JobQueue::Turn turn{*rc::gen::inRange<std::uint8_t>(0, 3),
                                at(*rc::gen::inRange(0, 6) * 1ms)};
      const auto count = *rc::gen::inRange<std::uint16_t>(1, 5);
      queue.add(id, turn, 0, count, 10);
      model.push_back({id, turn, count});
    } else if (*rc::gen::arbitrary<bool>()) {
      queue.remove(id);
      model.erase(known);
    } else if (*rc::gen::arbitrary<bool>()) {
      queue.push_again(*queue.find(id), 0);
      ++known->pieces;
    } else if (queue.take(*queue.find(id))) {
      --known->pieces;
    }
    RC_ASSERT(queue.size() == model.size());
    const auto first = std::ranges::min_element(model, {}, &Model::turn);
    RC_ASSERT((queue.first() == nullptr) == (first == model.end()));
    if (first != model.end()) RC_ASSERT(queue.first()->message == first->message);
    for (int ms = -1; ms < 7; ++ms) {
      for (const std::uint8_t rank : std::array<std::uint8_t, 3>{0, 1, 3}) {
        const JobQueue::Turn turn{rank, at(ms * 1ms)};
        std::size_t bytes = 0;
        for (const Model& m : model) bytes += m.turn <= turn ? 10 * m.pieces : 0;
        RC_ASSERT(queue.bytes_before(turn) == bytes);
      }
    }
    RC_ASSERT(queue.bytes() == queue.bytes_before({UINT8_MAX, TimePoint::max()}));
  }
}

}  // namespace
}  // namespace interneuron::flow::job_queue_test
