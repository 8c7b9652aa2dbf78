#include "node/io/poller.h"

#include <gtest/gtest.h>
#include <linux/errqueue.h>
#include <linux/net_tstamp.h>
#include <sys/socket.h>

#include <chrono>
#include <thread>
#include <vector>

#include "node/io/steady_clock.h"
#include "node/io/udp_socket.h"
#include "support.h"

namespace interneuron::io::poller_test {
namespace {

using namespace std::chrono_literals;

// What is ready now, of everything.
std::vector<Poller::Ready> ready_now(Poller& poller) {
  poller.prepare(Poller::For::kAnything);
  const auto ready = poller.wait(TimePoint::min());
  return {ready.begin(), ready.end()};
}

UdpOptions on_lo() { return {.nic = "lo", .local = *parse_address("127.0.0.1:0")}; }

TEST(Poller, NamesTheSocketsThatHaveSomethingToRead) {
  UdpTransport quiet(on_lo());
  UdpTransport busy(on_lo());
  Poller poller;
  poller.add(quiet.native_handle(), 7);
  poller.add(busy.native_handle(), 9);
  EXPECT_TRUE(ready_now(poller).empty());

  quiet.send(to_all(busy.local_address(), {payload(0, 100)}));
  ASSERT_TRUE(wait_for(busy, POLLIN));
  // It stays ready until it is read.
  for (int i = 0; i < 2; ++i) {
    const auto ready = ready_now(poller);
    ASSERT_EQ(ready.size(), 1u);
    EXPECT_EQ(ready[0].name, 9u);
    EXPECT_TRUE(ready[0].readable);
    EXPECT_FALSE(ready[0].writable);
  }
  EXPECT_FALSE(busy.drained()) << "nothing was received yet";
  EXPECT_EQ(busy.receive().size(), 1u);
  EXPECT_TRUE(busy.drained());
  EXPECT_TRUE(ready_now(poller).empty());
}

TEST(Poller, TellsOfTheErrorQueueUntilItIsEmpty) {
  UdpTransport sender(on_lo());
  const UdpTransport receiver(on_lo());
  const int stamps = SOF_TIMESTAMPING_TX_SOFTWARE | SOF_TIMESTAMPING_SOFTWARE;
  ASSERT_EQ(
      ::setsockopt(sender.native_handle(), SOL_SOCKET, SO_TIMESTAMPING, &stamps, sizeof stamps), 0);
  Poller poller;
  poller.add(sender.native_handle(), 1);
  sender.send(to_all(receiver.local_address(), {payload(0, 100)}));
  ASSERT_TRUE(wait_for(sender, POLLERR));
  ASSERT_EQ(ready_now(poller).size(), 1u);
  EXPECT_TRUE(ready_now(poller)[0].readable);
  EXPECT_TRUE(sender.receive().empty());
  EXPECT_EQ(sender.counters().error_reports, 1u);
  EXPECT_TRUE(ready_now(poller).empty());
}

TEST(Poller, TellsOfRoomToWriteWhereSomebodyWaitsForIt) {
  UdpTransport socket(on_lo());
  Poller poller;
  poller.add(socket.native_handle(), 1);
  poller.set_wants_write(socket.native_handle(), true);
  ASSERT_EQ(ready_now(poller).size(), 1u);
  EXPECT_TRUE(ready_now(poller)[0].writable);
  EXPECT_FALSE(ready_now(poller)[0].readable);
  poller.set_wants_write(socket.native_handle(), false);
  EXPECT_TRUE(ready_now(poller).empty());
}

TEST(Poller, ForgetsWhatWasRemoved) {
  UdpTransport here(on_lo());
  UdpTransport there(on_lo());
  Poller poller;
  poller.add(there.native_handle(), 1);
  here.send(to_all(there.local_address(), {payload(0, 100)}));
  ASSERT_TRUE(wait_for(there, POLLIN));
  poller.remove(there.native_handle());
  EXPECT_TRUE(ready_now(poller).empty());
}

TEST(Poller, SleepsUntilAnInstantAndNoLonger) {
  const PreciseTimers precise;
  Poller poller;
  for (const Duration time : {1ms, 30ms}) {
    const TimePoint until = now() + time;
    EXPECT_TRUE(poller.wait(until).empty());
    EXPECT_GE(now(), until);
  }
  // What has passed already is not waited for.
  EXPECT_TRUE(poller.wait(TimePoint::min()).empty());
}

TEST(Poller, IsWokenByAnyThreadOnceForAllCalls) {
  Poller poller;
  std::thread other([&] {
    poller.wake();
    poller.wake();
  });
  EXPECT_TRUE(poller.wait(TimePoint::max()).empty());
  other.join();
  poller.wake();
  EXPECT_TRUE(poller.wait(TimePoint::max()).empty());
  const TimePoint until = now() + 1ms;
  poller.wait(until);
  EXPECT_GE(now(), until) << "nobody has called since";
}

TEST(Poller, LeavesHandlesAloneWhereOnlyACallIsToWakeIt) {
  UdpTransport here(on_lo());
  UdpTransport there(on_lo());
  Poller poller;
  poller.add(there.native_handle(), 1);
  here.send(to_all(there.local_address(), {payload(0, 100)}));
  ASSERT_TRUE(wait_for(there, POLLIN));
  poller.prepare(Poller::For::kWake);
  const TimePoint until = now() + 1ms;
  EXPECT_TRUE(poller.wait(until).empty());
  EXPECT_GE(now(), until);
  EXPECT_EQ(ready_now(poller).size(), 1u);
}

}  // namespace
}  // namespace interneuron::io::poller_test
