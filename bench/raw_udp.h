// A pair of programs that send and receive as many bytes at the same pace as Nodes do, by UDP with
// segmentation offload and nothing else: what node_bench compares a Node with.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "bench/two_processes.h"
#include "interneuron/sizes.h"
#include "interneuron/units.h"
#include "node/io/file_descriptor.h"

namespace interneuron::bench {

inline constexpr std::uint16_t kRawPort = 47'001;
// A Node's own socket buffers are as large.
inline constexpr int kBufferBytes = 4 << 20;

inline sockaddr_in raw_address() {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(kRawPort);
  ::inet_pton(AF_INET, kRoadAddress, &address.sin_addr);
  return address;
}

inline io::FileDescriptor raw_socket() {
  io::FileDescriptor fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  for (const int option : {SO_RCVBUFFORCE, SO_SNDBUFFORCE, SO_RCVBUF, SO_SNDBUF}) {
    ::setsockopt(fd.get(), SOL_SOCKET, option, &kBufferBytes, sizeof kBufferBytes);
  }
  return fd;
}

inline Cost raw_send(int hertz, std::size_t messages, std::size_t bytes) {
  const io::FileDescriptor fd = raw_socket();
  const sockaddr_in to = raw_address();
  const int segment = kMaxDatagramBytes;
  ::setsockopt(fd.get(), SOL_UDP, UDP_SEGMENT, &segment, sizeof segment);
  const Bytes message(bytes);
  constexpr std::size_t kOneCall = 46 * kMaxDatagramBytes;
  timespec next{};
  ::clock_gettime(CLOCK_MONOTONIC, &next);
  const Usage before = usage();
  for (std::size_t i = 0; i < messages; ++i) {
    next.tv_nsec += 1'000'000'000 / hertz;
    if (next.tv_nsec >= 1'000'000'000) {
      next.tv_nsec -= 1'000'000'000;
      ++next.tv_sec;
    }
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, nullptr);
    for (std::size_t at = 0; at < message.size(); at += kOneCall) {
      ::sendto(fd.get(), &message[at], std::min(kOneCall, message.size() - at), 0,
               reinterpret_cast<const sockaddr*>(&to), sizeof to);
    }
  }
  return cost_since(before, messages);
}

// Until nothing has come for half a second.
inline Cost raw_receive(std::size_t message_bytes) {
  const io::FileDescriptor fd = raw_socket();
  const sockaddr_in own = raw_address();
  const int on = 1;
  ::setsockopt(fd.get(), SOL_UDP, UDP_GRO, &on, sizeof on);
  timeval patience{5, 0};
  ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) return {};
  std::vector<std::byte> buffer(64 * 1024);
  std::size_t bytes = 0;
  const Usage before = usage();
  for (;;) {
    const ssize_t size = ::recv(fd.get(), buffer.data(), buffer.size(), 0);
    if (size <= 0) return cost_since(before, bytes / message_bytes);
    if (bytes == 0) {
      patience = {0, 500'000};
      ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    }
    bytes += static_cast<std::size_t>(size);
  }
}

}  // namespace interneuron::bench
