// Identifiers and quantities as distinct types, so that a link's number can never be passed as a
// round's number. Plain values: comparable, hashable, not converted by themselves.
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

// An identifier: a number of type Rep that is only comparable with those of the same Tag.
template <class Tag, class Rep>
struct Id {
  using rep = Rep;
  Rep value{};
  friend constexpr auto operator<=>(const Id&, const Id&) = default;
};

// A link: a network card (NIC) of this host towards a peer. The side that connects chooses the
// number, and packets carry it, so that both sides name the path between them alike.
using LinkId = Id<struct LinkTag, std::uint16_t>;
// One life of one endpoint: drawn at random when it starts; never 0.
using SessionId = Id<struct SessionTag, std::uint32_t>;
// This endpoint's own handle of a peer; never on the wire.
using PeerId = Id<struct PeerTag, std::uint32_t>;
// Unique within the endpoint that begins the pipeline's rounds.
using PipelineId = Id<struct PipelineTag, std::uint8_t>;
// Counts from 0 within a session and pipeline.
using RoundId = Id<struct RoundTag, std::uint32_t>;
// Counts within a session and direction.
using MessageId = Id<struct MessageTag, std::uint32_t>;

// A rate in bits per second; 0 usually stands for "not known".
struct DataRate {
  std::int64_t bits_per_second{};
  friend constexpr auto operator<=>(const DataRate&, const DataRate&) = default;

  static constexpr DataRate mbit(double value) { return {static_cast<std::int64_t>(value * 1e6)}; }
  constexpr double mbit() const { return static_cast<double>(bits_per_second) / 1e6; }
  constexpr DataRate scaled(double factor) const {
    return {static_cast<std::int64_t>(static_cast<double>(bits_per_second) * factor)};
  }
  // How long it takes to put `bytes` on the wire at this rate; Duration::max() for a rate of 0 or
  // less.
  constexpr Duration transmit_time(std::size_t bytes) const {
    if (bits_per_second <= 0) return Duration::max();
    const double ns = static_cast<double>(bytes) * 8e9 / static_cast<double>(bits_per_second);
    return Duration{static_cast<std::int64_t>(std::min(ns, 9.0e18))};
  }
};

// The rate at which `bytes` were carried in `time`; 0 when the time is not positive.
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
