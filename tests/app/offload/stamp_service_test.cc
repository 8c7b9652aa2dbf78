// Two services on the loopback NIC of a network namespace of their own, and a packet that is forged
// in the name of one of them.
#include "app/offload/road.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/ip.h>
#include <netinet/udp.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

#include "core/wire/stamp.h"
#include "node/io/file_descriptor.h"

namespace interneuron::offload::stamp_service_test {
namespace {

constexpr const char* kFirst = "127.0.0.1";
constexpr const char* kSecond = "127.0.0.2";
constexpr std::size_t kPacketBytes = 100;
// Each of them is answered before the next is asked, so whatever the services have to say to each
// other would have been said many times when the last is answered.
constexpr int kFences = 50;

sockaddr_in at(const char* host, std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_port = htons(port);
  ::inet_pton(AF_INET, host, &out.sin_addr);
  return out;
}

Bytes request() {
  Bytes out(kPacketBytes);
  wire::write_stamp_request(out, {7, 99, wire::kStampUnsynchronised}, out.size());
  return out;
}

// Moves the calling thread and those that it starts into a network namespace with a loopback NIC
// that is up. False where that needs a privilege.
bool enter_namespace() {
  if (::unshare(CLONE_NEWNET) != 0) return false;
  const io::FileDescriptor any(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq lo{};
  std::strcpy(lo.ifr_name, "lo");
  lo.ifr_flags = IFF_UP;
  return ::ioctl(any.get(), SIOCSIFFLAGS, &lo) == 0;
}

// A request to the first service that seems to come from the second.
void forge(std::uint16_t first, std::uint16_t second) {
  const Bytes payload = request();
  std::array<std::byte, sizeof(iphdr) + sizeof(udphdr) + kPacketBytes> packet{};
  iphdr ip{};
  ip.version = 4;
  ip.ihl = sizeof ip / 4;
  ip.ttl = 64;
  ip.protocol = IPPROTO_UDP;
  ip.saddr = at(kSecond, 0).sin_addr.s_addr;
  ip.daddr = at(kFirst, 0).sin_addr.s_addr;
  udphdr udp{};
  udp.source = htons(second);
  udp.dest = htons(first);
  udp.len = htons(sizeof udp + kPacketBytes);
  std::memcpy(packet.data(), &ip, sizeof ip);
  std::memcpy(packet.data() + sizeof ip, &udp, sizeof udp);
  std::memcpy(packet.data() + sizeof ip + sizeof udp, payload.data(), payload.size());
  const io::FileDescriptor raw(::socket(AF_INET, SOCK_RAW | SOCK_CLOEXEC, IPPROTO_RAW));
  const sockaddr_in to = at(kFirst, first);
  ASSERT_EQ(::sendto(raw.get(), packet.data(), packet.size(), 0,
                     reinterpret_cast<const sockaddr*>(&to), sizeof to),
            static_cast<ssize_t>(packet.size()));
}

// Asks as an honest sender and waits for the answer.
void ask(int socket, const char* host, std::uint16_t port) {
  const Bytes bytes = request();
  const sockaddr_in to = at(host, port);
  ::sendto(socket, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
           sizeof to);
  std::array<std::byte, 2 * kPacketBytes> answer;
  ASSERT_EQ(::recv(socket, answer.data(), answer.size(), 0), static_cast<ssize_t>(kPacketBytes));
}

// What the UDP sockets of the calling thread's namespace have sent.
int sent_datagrams() {
  std::ifstream file("/proc/thread-self/net/snmp");
  std::string names;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("Udp: ")) continue;
    if (names.empty()) {
      names = line;
      continue;
    }
    std::istringstream name_stream(names);
    std::istringstream value_stream(line);
    std::string name;
    for (std::string value; name_stream >> name && value_stream >> value;) {
      if (name == "OutDatagrams") return std::stoi(value);
    }
  }
  return -1;
}

// How many packets the two services send each other after one that was forged.
int answers_to_forged(std::uint16_t first, std::uint16_t second) {
  StampOptions options{.port = first};
  const StampService one(options, {"lo"}, kFirst);
  options.port = second;
  const StampService two(options, {"lo"}, kSecond);
  const io::FileDescriptor client(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const timeval patience{10, 0};
  ::setsockopt(client.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const int before = sent_datagrams();
  forge(first, second);
  for (int i = 0; i < kFences; ++i) {
    ask(client.get(), kFirst, first);
    ask(client.get(), kSecond, second);
  }
  return sent_datagrams() - before - 4 * kFences;
}

TEST(StampService, TwoOfThemAndOneForgedPacketMakeAtMostTwoPackets) {
  bool entered = false;
  std::array<int, 3> answers{};
  std::thread([&] {
    entered = enter_namespace();
    if (!entered) return;
    answers = {answers_to_forged(862, 862), answers_to_forged(9001, 9001),
               answers_to_forged(9001, 9002)};
  }).join();
  if (!entered) GTEST_SKIP() << "needs the privilege to make a network namespace";
  for (const int count : answers) {
    EXPECT_GE(count, 0);
    EXPECT_LE(count, 1) << "beside the forged one";
  }
}

}  // namespace
}  // namespace interneuron::offload::stamp_service_test
