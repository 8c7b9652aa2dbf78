#include "tests/netns/attacker/spoof.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/ip.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "core/wire/bytes.h"
#include "interneuron/sizes.h"

namespace interneuron::attacker {
namespace {

constexpr int kSendBufferBytes = 4 * 1024 * 1024;
constexpr std::size_t kIpBytes = 20;

}  // namespace

SpoofSocket::SpoofSocket(const std::string& nic)
    : socket_(::socket(AF_INET, SOCK_RAW | SOCK_CLOEXEC, IPPROTO_RAW)) {
  if (socket_.get() < 0) fail_call("raw socket");
  if (::setsockopt(socket_.get(), SOL_SOCKET, SO_BINDTODEVICE, nic.c_str(),
                   static_cast<socklen_t>(nic.size())) != 0) {
    fail_call("SO_BINDTODEVICE " + nic);
  }
  ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
}

// The kernel fills in the checksum of the IP header and its identification.
void SpoofSocket::add(Place from, Place to, ByteView payload) {
  const auto size = static_cast<std::uint16_t>(kIpUdpBytes + payload.size());
  Bytes out(size);
  wire::Writer w(out);
  w.put(std::uint8_t{0x45});
  w.put(std::uint8_t{0});
  w.put(size);
  w.put(std::uint32_t{0});
  w.put(std::uint8_t{64});
  w.put(static_cast<std::uint8_t>(IPPROTO_UDP));
  w.put(std::uint16_t{0});
  w.put(from.host);
  w.put(to.host);
  w.put(from.port);
  w.put(to.port);
  w.put(static_cast<std::uint16_t>(size - kIpBytes));
  w.put(std::uint16_t{0});
  w.put_bytes(payload);
  batch_.push_back({to.host, std::move(out)});
  if (batch_.size() == kBatch) flush();
}

void SpoofSocket::flush() {
  std::array<sockaddr_in, kBatch> to{};
  std::array<iovec, kBatch> parts{};
  std::array<mmsghdr, kBatch> messages{};
  for (std::size_t i = 0; i < batch_.size(); ++i) {
    to[i].sin_family = AF_INET;
    to[i].sin_addr.s_addr = htonl(batch_[i].to);
    parts[i] = {batch_[i].bytes.data(), batch_[i].bytes.size()};
    messages[i].msg_hdr.msg_name = &to[i];
    messages[i].msg_hdr.msg_namelen = sizeof to[i];
    messages[i].msg_hdr.msg_iov = &parts[i];
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  const int sent =
      ::sendmmsg(socket_.get(), messages.data(), static_cast<unsigned>(batch_.size()), 0);
  if (sent < 0 && errno != ENOBUFS && errno != EINTR) fail_call("sendmmsg");
  for (int i = 0; i < sent; ++i) bytes_ += batch_[static_cast<std::size_t>(i)].bytes.size();
  packets_ += static_cast<std::uint64_t>(std::max(sent, 0));
  batch_.clear();
}

}  // namespace interneuron::attacker
