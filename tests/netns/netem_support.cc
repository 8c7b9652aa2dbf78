#include "netem_support.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>

namespace interneuron::netns {

namespace {

constexpr int kPort = 7000;
constexpr int kBufferBytes = 64 << 20;
constexpr std::size_t kBatch = 64;

Duration realtime() {
  timespec t{};
  ::clock_gettime(CLOCK_REALTIME, &t);
  return std::chrono::seconds(t.tv_sec) + Duration(t.tv_nsec);
}

io::FileDescriptor current() {
  return io::FileDescriptor(::open("/proc/self/ns/net", O_RDONLY | O_CLOEXEC));
}

// Empty when there is none to be had. IPv6 would add packets of its own to every count.
io::FileDescriptor fresh() {
  if (::unshare(CLONE_NEWNET) != 0) return io::FileDescriptor();
  for (const char* which : {"all", "default"}) {
    std::ofstream("/proc/sys/net/ipv6/conf/" + std::string(which) + "/disable_ipv6") << 1;
  }
  return current();
}

void enter(const io::FileDescriptor& network_namespace) {
  if (::setns(network_namespace.get(), CLONE_NEWNET) != 0) std::abort();
}

// A line each for `ip`, all in one process, because that takes a slow virtual machine 0.1 s.
void ip(const std::string& batch) {
  FILE* pipe = ::popen("ip -batch -", "w");
  ASSERT_NE(pipe, nullptr);
  std::fputs(batch.c_str(), pipe);
  ASSERT_EQ(::pclose(pipe), 0) << batch;
}

std::string address(bool left, int network) {
  return "10.99." + std::to_string(network) + (left ? ".1" : ".2");
}

// Neighbours are set, so that ARP adds no packets.
std::string configuration(bool left, int network) {
  const std::string nic = "veth" + std::to_string(network);
  const std::string mac = "02:99:00:00:00:0";
  const std::string own = mac + (left ? "1" : "2");
  const std::string other = mac + (left ? "2" : "1");
  return "link set " + nic + " address " + own + " up\naddress add " + address(left, network) +
         "/24 dev " + nic + "\nneighbour add " + address(!left, network) + " lladdr " + other +
         " dev " + nic + "\n";
}

sockaddr_in socket_address(const std::string& text) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(kPort);
  ::inet_pton(AF_INET, text.c_str(), &out.sin_addr);
  return out;
}

struct Payload {
  std::uint32_t number;
  std::int64_t sent_ns;
};

}  // namespace

void NetemTest::SetUp() {
  home_ = current();
  right_ = fresh();
  left_ = fresh();
  if (left_.get() < 0) GTEST_SKIP() << "may not make network namespaces: needs root";
  if (!kernel_has_netem()) GTEST_SKIP() << "no netem in this kernel: scripts/vm.sh has one";
  join(1, 1);
}

void NetemTest::TearDown() {
  if (left_.get() >= 0) enter(home_);  // else it never left, and may not enter any
}

void NetemTest::join(int first, int last) {
  const std::string other =
      "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(right_.get());
  std::string left_batch;
  std::string right_batch;
  for (int network = first; network <= last; ++network) {
    const std::string nic = "veth" + std::to_string(network);
    left_batch += "link add " + nic + " type veth peer name " + nic + " netns " + other + "\n" +
                  configuration(true, network);
    right_batch += configuration(false, network);
  }
  enter(left_);
  ip(left_batch);
  enter(right_);
  ip(right_batch);
  enter(left_);
}

io::FileDescriptor NetemTest::udp(bool left, int network) const {
  enter(left ? left_ : right_);
  io::FileDescriptor out(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const int on = 1;
  ::setsockopt(out.get(), SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  ::setsockopt(out.get(), SOL_SOCKET, SO_RCVBUFFORCE, &kBufferBytes, sizeof kBufferBytes);
  ::setsockopt(out.get(), SOL_SOCKET, SO_SNDBUFFORCE, &kBufferBytes, sizeof kBufferBytes);
  const sockaddr_in own = socket_address(address(left, network));
  const sockaddr_in peer = socket_address(address(!left, network));
  EXPECT_EQ(::bind(out.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own), 0);
  EXPECT_EQ(::connect(out.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer), 0);
  enter(left_);
  return out;
}

emu::Conditions clean(double rate_mbit, Duration one_way) {
  return emu::Conditions{
      .one_way = one_way, .rate = DataRate::mbit(rate_mbit), .queue_bytes = 100'000'000};
}

void send_numbered(int fd, std::uint32_t first, std::size_t count, std::size_t ip_bytes) {
  const std::size_t size = ip_bytes - kUdpHeaders;
  std::vector<std::byte> bytes(count * size);
  std::vector<iovec> parts(count);
  std::vector<mmsghdr> messages(count);
  const std::int64_t now = realtime().count();
  for (std::size_t i = 0; i < count; ++i) {
    const Payload payload{first + static_cast<std::uint32_t>(i), now};
    std::memcpy(&bytes[i * size], &payload, sizeof payload);
    parts[i] = {&bytes[i * size], size};
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  std::size_t sent = 0;
  while (sent < count) {
    const int result = ::sendmmsg(fd, &messages[sent], static_cast<unsigned>(count - sent), 0);
    ASSERT_GT(result, 0) << std::strerror(errno);
    sent += static_cast<std::size_t>(result);
  }
}

namespace {

Arrival arrival_of(const msghdr& message, const Payload& payload) {
  Arrival out{payload.number, {}, {}};
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr;
       c = CMSG_NXTHDR(const_cast<msghdr*>(&message), c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec t{};
    std::memcpy(&t, CMSG_DATA(c), sizeof t);
    out.at = std::chrono::seconds(t.tv_sec) + Duration(t.tv_nsec);
  }
  out.delay = out.at - Duration(payload.sent_ns);
  return out;
}

}  // namespace

void receive_numbered(int fd, std::vector<Arrival>& arrivals, Duration patience) {
  std::array<Payload, kBatch> payloads{};
  std::array<std::array<char, 64>, kBatch> controls{};
  std::array<iovec, kBatch> parts{};
  std::array<mmsghdr, kBatch> messages{};
  const int patience_ms =
      static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(patience).count());
  while (true) {
    for (std::size_t i = 0; i < kBatch; ++i) {
      parts[i] = {&payloads[i], sizeof payloads[i]};
      messages[i].msg_hdr = {};
      messages[i].msg_hdr.msg_iov = &parts[i];
      messages[i].msg_hdr.msg_iovlen = 1;
      messages[i].msg_hdr.msg_control = controls[i].data();
      messages[i].msg_hdr.msg_controllen = controls[i].size();
    }
    const int count = ::recvmmsg(fd, messages.data(), kBatch, MSG_DONTWAIT, nullptr);
    for (int i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      arrivals.push_back(arrival_of(messages[at].msg_hdr, payloads[at]));
    }
    pollfd readable{fd, POLLIN, 0};
    if (count <= 0 && ::poll(&readable, 1, patience_ms) <= 0) return;
  }
}

std::vector<Arrival> stream(int from, int to, std::size_t count, std::size_t ip_bytes) {
  constexpr std::size_t kAtOnce = 50;
  std::vector<Arrival> out;
  for (std::size_t sent = 0; sent < count; sent += kAtOnce) {
    send_numbered(from, static_cast<std::uint32_t>(sent), std::min(kAtOnce, count - sent),
                  ip_bytes);
    receive_numbered(to, out);
  }
  receive_numbered(to, out, std::chrono::milliseconds(500));
  return out;
}

void rest(Duration time) {
  const timespec t{time / std::chrono::seconds(1), (time % std::chrono::seconds(1)).count()};
  ::nanosleep(&t, nullptr);
}

}  // namespace interneuron::netns
