// What an endpoint believes of one link towards one peer, as a value: a snapshot for policies,
// plots and tables. Also what the operator and the kernel say of a network card (NIC).
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "interneuron/few.h"
#include "interneuron/nature.h"
#include "interneuron/units.h"

namespace interneuron {

// What the kernel says of a NIC: each state needs all before it (docs/links.md, "States").
enum class NicState : std::uint8_t {
  kAbsent,     // no NIC of that name in this network namespace
  kNoCarrier,  // administratively down, or nothing at the other end
  kNoAddress,  // no usable address of the family that is needed
  kNoRoute,    // nothing routes to the peer (without one: to the Internet) through this NIC
  kReady,
};
std::string_view to_string(NicState state);  // "absent", "no_carrier", …

// What the traffic of a path says of it (docs/links.md, "How a link is measured").
enum class PathState : std::uint8_t {
  kOk,       // full share
  kSuspect,  // loaded and without feedback, or a long queue: still used
  kPulled,   // loaded and silent: no new data; the first sign of life brings it back
  kLatched,  // no proof of delivery for seconds: probes only, until proof has lasted
  kDead,     // the NIC is gone, or nothing was heard for 4 s, longer where heartbeats are rare
};
std::string_view to_string(PathState state);  // "ok", "suspect", …

enum class LinkRole : std::uint8_t {
  kNormal,
  kBackup,  // only where no normal link meets the floors
  kNever,   // measured, not used
};
std::string_view to_string(LinkRole role);  // "normal", "backup", "never"

// What the operator says of a link.
struct LinkTraits {
  LinkRole role = LinkRole::kNormal;
  int priority = 0;      // smaller first; scores decide among equals
  bool metered = false;  // pays per byte: no rate trains, the rate is learnt from data
  std::optional<DataRate> rate_cap{};  // never sent faster
  bool trusted = false;  // the network is the operator's own: half of the security score
  friend bool operator==(const LinkTraits&, const LinkTraits&) = default;
};

// A NIC of this host as the endpoint is told of it.
struct LinkInfo {
  std::string name;  // the NIC's name
  std::size_t mtu =
      1500;  // of the IP layer, bytes; datagrams never exceed it, so that IP never fragments
  LinkTraits traits{};
};

// The measured state behind a Nature, in units. "Up" is from here to the peer, "down" from the peer
// to here. Durations are zero and rates 0 while nothing was measured.
struct LinkState {
  LinkId id{};
  bool up = false;  // new data may be sent: path is kOk or kSuspect, and the role is not kNever
  PathState path = PathState::kDead;
  LinkTraits traits{};
  Duration rtt_p50{};   // of the last 2 s
  Duration rtt_p95{};   // of the last 2 s
  Duration rtt_min{};   // of the last 10 s
  Duration jitter{};    // RTTVAR of RFC 6298
  Duration queue_up{};  // one-way queue signal: above the smallest one-way delay of 10 s
  Duration queue_down{};
  DataRate rate{};        // up
  DataRate rate_down{};   // as the peer reports it
  double loss = 0;        // up, share of packets, smoothed
  double loss_down = 0;   // as the peer reports it
  double loss_burst = 0;  // mean number of packets lost in a row, 0 while none was
  double outage = 0;      // share of the last 60 s in which the path was not up
  Duration age{};         // of the newest evidence of any kind; max() = never heard
  Duration rate_age{};    // of the newest evidence of the rate; max() = none
  double confidence = 0;  // [0, 1]: 1 = measured now, halves with age (src/core/link/nature.h)
  // How much evidence there is: round trips behind the quantiles, packets behind the loss, trains
  // of full length behind the rate (at most three count).
  std::uint32_t rtt_samples = 0;
  std::uint32_t loss_packets = 0;
  std::uint32_t rate_trains = 0;
  Nature nature{};
};

// The links towards one peer that are weighed against each other; chosen: more NICs than a vehicle
// has. Further ones are measured, but nothing is planned over them.
inline constexpr std::size_t kMaxLinks = 16;
using Links = Few<LinkState, kMaxLinks>;

}  // namespace interneuron
