// Helpers for tests that move real datagrams. Waits are on conditions, with a bound.
#pragma once

#include <dirent.h>
#include <poll.h>

#include <chrono>
#include <cstring>
#include <memory>
#include <vector>

#include "interneuron/transport.h"

namespace interneuron::io {

// Long, because a loaded machine with sanitizers is slow; a test that passes never waits for it.
inline constexpr std::chrono::seconds kPatience{20};

inline bool wait_for(const Transport& transport, short events) {
  pollfd item{.fd = transport.native_handle(), .events = events, .revents = 0};
  return ::poll(&item, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count())) == 1;
}

// A payload that tells which one it is: its number, then bytes that depend on number and position.
inline Bytes payload(std::size_t number, std::size_t size) {
  Bytes out(size);
  for (std::size_t i = 0; i < size; ++i) out[i] = static_cast<std::byte>((number * 31 + i) & 0xff);
  const auto tag = static_cast<std::uint32_t>(number);
  if (size > 0) std::memcpy(out.data(), &tag, std::min(size, sizeof tag));
  return out;
}

inline std::vector<Outgoing> to_all(const Address& to, const std::vector<Bytes>& payloads) {
  std::vector<Outgoing> out;
  for (const Bytes& bytes : payloads) out.push_back({to, bytes});
  return out;
}

// Receives until `count` datagrams are there or nothing comes any more.
inline std::vector<Bytes> receive_all(Transport& transport, std::size_t count) {
  std::vector<Bytes> out;
  while (out.size() < count && wait_for(transport, POLLIN)) {
    for (const Incoming& datagram : transport.receive()) {
      out.emplace_back(datagram.bytes.begin(), datagram.bytes.end());
    }
  }
  return out;
}

inline std::size_t open_descriptors() {
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(::opendir("/proc/self/fd"), &::closedir);
  std::size_t count = 0;
  while (::readdir(folder.get()) != nullptr) ++count;
  return count;
}

}  // namespace interneuron::io
