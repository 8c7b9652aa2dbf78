#include "node/loop/node_impl.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <memory>

namespace interneuron::workers_test {
namespace {

TEST(Workers, RunsEveryJobInOrder) {
  std::vector<int> order;
  std::latch done(1);
  Workers workers(1);
  for (int i = 0; i < 100; ++i) workers.submit([&order, i] { order.push_back(i); });
  workers.submit([&] { done.count_down(); });
  done.wait();
  ASSERT_EQ(order.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(order[static_cast<std::size_t>(i)], i);
}

TEST(Workers, ManyThreadsRunJobsAtTheSameTime) {
  Workers workers(3);
  std::latch all_there(3);
  std::latch done(3);
  for (int i = 0; i < 3; ++i) {
    workers.submit([&] {
      all_there.arrive_and_wait();  // passes only if the three run together
      done.count_down();
    });
  }
  done.wait();
}

TEST(Workers, StopWaitsForWhatRunsAndDropsWhatWaits) {
  std::latch started(1);
  std::latch go(1);
  std::atomic<int> finished{0};
  const auto captured = std::make_shared<int>(0);
  {
    Workers workers(1);
    workers.submit([&] {
      started.count_down();
      go.wait();
      ++finished;
    });
    for (int i = 0; i < 10; ++i) workers.submit([&finished, captured] { ++finished; });
    started.wait();
    // The worker is busy until `go`; another thread opens it while stop() already waits or soon
    // will.
    std::thread opener([&] { go.count_down(); });
    workers.stop();
    opener.join();
    EXPECT_GE(finished, 1);
    workers.submit([&finished] { finished = 1000; });
  }
  EXPECT_LT(finished, 1000);
  EXPECT_EQ(captured.use_count(), 1) << "dropped jobs are destroyed";
}

}  // namespace
}  // namespace interneuron::workers_test
