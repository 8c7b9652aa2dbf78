// Many small messages at once cost few system calls: whatever the program asks of the kernel is
// counted, by what the linker puts in the place of the functions that do so.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include "interneuron/node.h"

namespace {
// Calls of this thread.
thread_local int calls = 0;
}  // namespace

extern "C" {
ssize_t __real_sendmsg(int, const msghdr*, int);
ssize_t __wrap_sendmsg(int fd, const msghdr* message, int flags) {
  ++calls;
  return __real_sendmsg(fd, message, flags);
}
int __real_sendmmsg(int, mmsghdr*, unsigned, int);
int __wrap_sendmmsg(int fd, mmsghdr* messages, unsigned count, int flags) {
  ++calls;
  return __real_sendmmsg(fd, messages, count, flags);
}
ssize_t __real_recvmsg(int, msghdr*, int);
ssize_t __wrap_recvmsg(int fd, msghdr* message, int flags) {
  ++calls;
  return __real_recvmsg(fd, message, flags);
}
int __real_recvmmsg(int, mmsghdr*, unsigned, int, timespec*);
int __wrap_recvmmsg(int fd, mmsghdr* messages, unsigned count, int flags, timespec* time) {
  ++calls;
  return __real_recvmmsg(fd, messages, count, flags, time);
}
int __real_ppoll(pollfd*, nfds_t, const timespec*, const sigset_t*);
int __wrap_ppoll(pollfd* handles, nfds_t count, const timespec* time, const sigset_t* mask) {
  ++calls;
  return __real_ppoll(handles, count, time, mask);
}
}

namespace interneuron::many_test {
namespace {

using std::chrono::milliseconds;

constexpr int kMessages = 64;

NodeOptions options_on_loopback() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = LinkId{1}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  return options;
}

// Of ten spans the one that cost the least until the fates of all its messages were told: what else
// goes on, heartbeats and feedback of a busy machine, is nobody's cost.
TEST(NodeSendMany, ASpanOf64SmallMessagesCostsFewSystemCalls) {
  Node road(options_on_loopback());
  NodeOptions options = options_on_loopback();
  options.accept_peers = false;
  options.links[0].peer = to_string(*road.local_address(LinkId{1}));
  Node vehicle(std::move(options));
  std::thread loop([&road] { road.run(); });

  std::optional<PeerId> peer;
  int open = 0;
  int delivered = 0;
  int before = 0;
  std::vector<int> cost;
  const std::function<void()> send = [&] {
    std::vector<Bytes> messages(kMessages, Bytes(100, std::byte{7}));
    before = calls;
    for (const SendResult& r :
         vehicle.send(*peer, std::span(messages), {.deadline = milliseconds(1000)})) {
      open += r.accepted() ? 1 : 0;
    }
    EXPECT_EQ(open, kMessages);
  };
  vehicle.on_peer_ready([&](PeerReady p) {
    peer = p.peer;
    vehicle.after(milliseconds(500), send);
  });
  vehicle.on_fate([&](MessageFate fate) {
    delivered += fate.fate == Fate::kDelivered ? 1 : 0;
    if (--open > 0) return;
    cost.push_back(calls - before);
    if (cost.size() == 10) return vehicle.stop();
    vehicle.after(milliseconds(50), send);
  });
  vehicle.after(std::chrono::seconds(20), [] { throw std::runtime_error("it took too long"); });
  vehicle.run();
  road.stop();
  loop.join();
  EXPECT_EQ(delivered, 10 * kMessages);
  EXPECT_LE(std::ranges::min(cost), kMessages * 3 / 10) << ::testing::PrintToString(cost);
}

}  // namespace
}  // namespace interneuron::many_test
