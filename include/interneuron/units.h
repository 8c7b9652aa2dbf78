// Identifiers and quantities as distinct types, so that a link number can never be passed as a
// round number.
#pragma once

#include <algorithm>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "interneuron/time.h"

namespace interneuron {

using Bytes = std::vector<std::byte>;
using ByteView = std::span<const std::byte>;

template <class Tag, class Rep>
struct Id {
  using rep = Rep;
  Rep value{};
  friend constexpr auto operator<=>(const Id&, const Id&) = default;
};

using LinkId =
    Id<struct LinkTag, std::uint8_t>;  // a NIC of this host; the same number names its counterpart
using SessionId =
    Id<struct SessionTag, std::uint32_t>;          // one life of one endpoint, random, never 0
using PeerId = Id<struct PeerTag, std::uint32_t>;  // local handle of a peer; never on the wire
using PipelineId = Id<struct PipelineTag, std::uint8_t>;  // unique within its origin
using RoundId = Id<struct RoundTag, std::uint32_t>;  // counts from 0 within a session and pipeline
using MessageId = Id<struct MessageTag, std::uint32_t>;  // counts within a session and direction

// Bits per second.
struct DataRate {
  std::int64_t bits_per_second{};
  friend constexpr auto operator<=>(const DataRate&, const DataRate&) = default;

  static constexpr DataRate mbit(double value) { return {static_cast<std::int64_t>(value * 1e6)}; }
  constexpr double mbit() const { return static_cast<double>(bits_per_second) / 1e6; }
  constexpr DataRate scaled(double factor) const {
    return {static_cast<std::int64_t>(static_cast<double>(bits_per_second) * factor)};
  }
  // Time to put `bytes` on the wire at this rate; a rate of 0 or less means "never"
  // (Duration::max()).
  constexpr Duration transmit_time(std::size_t bytes) const {
    if (bits_per_second <= 0) return Duration::max();
    const double ns = static_cast<double>(bytes) * 8e9 / static_cast<double>(bits_per_second);
    return Duration{static_cast<std::int64_t>(std::min(ns, 9.0e18))};
  }
};

// The rate at which `bytes` in `time` were carried; 0 when time is not positive.
constexpr DataRate rate_of(std::size_t bytes, Duration time) {
  if (time.count() <= 0) return {};
  const double bps = static_cast<double>(bytes) * 8e9 / static_cast<double>(time.count());
  return {static_cast<std::int64_t>(std::min(bps, 9.0e18))};
}

}  // namespace interneuron

template <class Tag, class Rep>
struct std::hash<interneuron::Id<Tag, Rep>> {
  std::size_t operator()(const interneuron::Id<Tag, Rep>& id) const noexcept {
    return std::hash<Rep>{}(id.value);
  }
};
