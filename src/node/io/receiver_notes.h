// Which of a NIC's own addresses a datagram came to, noted in the Address that it came from, so
// that the answer leaves from there: a NAT drops an answer from another address
// (docs/constants.md, "NICs and the kernel"). The note is one byte where the system reads nothing:
// in the padding of a sockaddr_in, or in the flow label of a sockaddr_in6, which the kernel ignores
// unless IPV6_FLOWINFO_SEND is set. It is the place of the address in a list, counted from 1; 0
// stands for none. A note is written here and never taken from a packet; it says something only to
// the transport that wrote it.
//
// At most 255 addresses are kept; what came to later ones is answered from the address that the
// kernel prefers. The transports of one link that serve it together share one list, so that a
// datagram may be answered by another than that which it came to. Thread-safe; no errors.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <mutex>

#include "node/io/address.h"

namespace interneuron::io {

class ReceiverNotes {
 public:
  // The bytes of an in_addr or in6_addr.
  using Host = std::array<std::byte, 16>;

  // The note of an in_addr or in6_addr of `size` bytes; 0 when there is no room for another.
  std::uint8_t note_of(const void* address, std::size_t size) {
    Host bytes{};
    std::memcpy(bytes.data(), address, std::min(size, bytes.size()));
    if (const std::uint8_t known = find(bytes)) return known;
    const std::lock_guard lock(adding_);
    if (const std::uint8_t known = find(bytes)) return known;
    const std::size_t count = count_.load(std::memory_order_relaxed);
    if (count >= hosts_.size()) return 0;
    hosts_[count] = bytes;
    count_.store(count + 1, std::memory_order_release);
    return static_cast<std::uint8_t>(count + 1);
  }
  // The address that is noted in this one; nullptr: none.
  const Host* find(const Address& address) const {
    const auto note = std::to_integer<std::size_t>(address.raw[place_in(address)]);
    const std::size_t count = count_.load(std::memory_order_acquire);
    return note > 0 && note <= count ? &hosts_[note - 1] : nullptr;
  }
  static void put(Address& address, std::uint8_t note) {
    address.raw[place_in(address)] = static_cast<std::byte>(note);
  }

 private:
  static std::size_t place_in(const Address& address) {
    return family_of(address) == AF_INET ? offsetof(sockaddr_in, sin_zero)
                                         : offsetof(sockaddr_in6, sin6_flowinfo);
  }

  // 0: it is not in the list.
  std::uint8_t find(const Host& bytes) const {
    const auto end =
        hosts_.begin() + static_cast<std::ptrdiff_t>(count_.load(std::memory_order_acquire));
    const auto it = std::find(hosts_.begin(), end, bytes);
    return it == end ? std::uint8_t{0} : static_cast<std::uint8_t>(it - hosts_.begin() + 1);
  }

  // The first count_ of them never change.
  std::array<Host, std::numeric_limits<std::uint8_t>::max()> hosts_{};
  std::atomic<std::size_t> count_{0};
  std::mutex adding_;
};

}  // namespace interneuron::io
