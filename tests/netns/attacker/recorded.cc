#include "tests/netns/attacker/recorded.h"

#include <arpa/inet.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>

#include "core/wire/bytes.h"
#include "core/wire/packet.h"

namespace interneuron::attacker {
namespace {

// Enough for seconds of a vehicle and for every kind of packet.
constexpr std::size_t kMostPackets = 4096;
constexpr std::size_t kMostHandshakes = 1024;
// By then a packet that came in here has been forwarded and read.
constexpr Duration kReached = std::chrono::milliseconds(200);
// The lengths in a capture: of the head of the file, of each frame's, and of Ethernet's.
constexpr std::size_t kFileHead = 24;
constexpr std::size_t kFrameHead = 16;
constexpr std::size_t kEthernetHead = 14;
// What can be sent again.
constexpr std::size_t kLargestUdp = 1480;
constexpr int kBufferBytes = 4 * 1024 * 1024;

std::optional<Recorded> parse_ip(ByteView packet) {
  wire::Reader head(packet);
  const auto words = head.get<std::uint8_t>();
  if (words >> 4 != 4 || packet.size() < 28) return std::nullopt;
  if (std::to_integer<int>(packet[9]) != IPPROTO_UDP) return std::nullopt;
  const std::size_t ip_bytes = 4 * static_cast<std::size_t>(words & 0x0F);
  wire::Reader hosts(packet.subspan(12));
  wire::Reader ports(packet.subspan(ip_bytes));
  Recorded out;
  out.from.host = hosts.get<std::uint32_t>();
  out.to.host = hosts.get<std::uint32_t>();
  out.from.port = ports.get<std::uint16_t>();
  out.to.port = ports.get<std::uint16_t>();
  const auto size = ports.get<std::uint16_t>();
  const ByteView udp = packet.subspan(ip_bytes);
  if (size < 8 || size > udp.size() || size > kLargestUdp) return std::nullopt;
  const ByteView payload = udp.subspan(8, size - 8);
  out.payload.assign(payload.begin(), payload.end());
  return out;
}

bool is_of_handshake(const Recorded& packet) {
  const auto header = wire::peek(packet.payload);
  return header && header->epoch == wire::kClearEpoch && wire::is_handshake(header->type);
}

}  // namespace

std::vector<Recorded> read_capture(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("'" + file + "' cannot be read");
  const std::vector<char> text((std::istreambuf_iterator<char>(in)),
                               std::istreambuf_iterator<char>());
  const ByteView all = std::as_bytes(std::span(text));
  std::vector<Recorded> out;
  for (std::size_t at = kFileHead; at + kFrameHead <= all.size();) {
    std::uint32_t size = 0;
    std::memcpy(&size, all.data() + at + 8, sizeof size);
    at += kFrameHead;
    if (size < kEthernetHead || size > all.size() - at) break;
    if (auto packet = parse_ip(all.subspan(at + kEthernetHead, size - kEthernetHead))) {
      out.push_back(std::move(*packet));
    }
    at += size;
  }
  return out;
}

Recorder::Recorder(const std::string& nic)
    : socket_(::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, htons(ETH_P_IP))) {
  if (socket_.get() < 0) fail_call("packet socket");
  ::setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &kBufferBytes, sizeof kBufferBytes);
  sockaddr_ll at{};
  at.sll_family = AF_PACKET;
  at.sll_protocol = htons(ETH_P_IP);
  at.sll_ifindex = static_cast<int>(::if_nametoindex(nic.c_str()));
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0) {
    fail_call("bind to " + nic);
  }
}

void Recorder::turn(TimePoint now) {
  std::array<std::byte, 2048> buffer;
  for (;;) {
    sockaddr_ll from{};
    socklen_t size = sizeof from;
    const ssize_t n = ::recvfrom(socket_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT,
                                 reinterpret_cast<sockaddr*>(&from), &size);
    if (n < 0) return;
    // Our own attack leaves here.
    if (from.sll_pkttype == PACKET_OUTGOING) continue;
    auto packet = parse_ip(ByteView(buffer).first(static_cast<std::size_t>(n)));
    if (!packet) continue;
    packet->at = now;
    if (is_of_handshake(*packet)) {
      if (handshakes_.size() < kMostHandshakes) handshakes_.push_back(std::move(*packet));
    } else if (packets_.size() < kMostPackets) {
      packets_.push_back(std::move(*packet));
    } else {
      packets_[next_] = std::move(*packet);
      next_ = (next_ + 1) % kMostPackets;
    }
  }
}

const Recorded* Recorder::newest() const {
  if (packets_.empty()) return nullptr;
  return packets_.size() < kMostPackets ? &packets_.back()
                                        : &packets_[(next_ + kMostPackets - 1) % kMostPackets];
}

const Recorded* Recorder::any(TimePoint now, std::mt19937_64& random) const {
  if (packets_.empty()) return nullptr;
  const Recorded& drawn = packets_[random() % packets_.size()];
  return now - drawn.at >= kReached ? &drawn : nullptr;
}

}  // namespace interneuron::attacker
