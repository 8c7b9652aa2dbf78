// What an endpoint believes of one link towards one peer, as a value: a snapshot for policies,
// plots and tables (docs/links.md says how it is measured). Also what the operator and the kernel
// say of a network card (NIC). Plain values.
#pragma once

#include <algorithm>
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
  // There is no NIC of that name in this network namespace.
  kAbsent,
  // It is administratively down, or nothing is at the other end.
  kNoCarrier,
  // It has no usable address of the family that is needed.
  kNoAddress,
  // Nothing routes to the peer (without a peer: to the Internet) through it.
  kNoRoute,
  // It can be used.
  kReady,
};
// "absent", "no_carrier", "no_address", "no_route", "ready".
std::string_view to_string(NicState state);

// What the traffic of a path says of it (docs/links.md, "How a link is measured").
enum class PathState : std::uint8_t {
  // Feedback comes, and no long queue has built up: it is fully used.
  kOk,
  // Feedback or heartbeats are late, or a long queue has built up: still used.
  kSuspect,
  // The peer is silent for longer than a round trip explains (60 ms at least while data is in
  // flight, 1.5 s without): no new data is sent until the peer is heard again.
  kPulled,
  // The peer is heard, but for seconds nothing that was sent was acknowledged: only probes are
  // sent,
  // until they have been acknowledged for a while.
  kLatched,
  // The NIC is gone, or nothing was heard for 4 s (longer where heartbeats are rare).
  kDead,
};
// "ok", "suspect", "pulled", "latched", "dead".
std::string_view to_string(PathState state);

// Whether queues on a path may mark our packets instead of dropping them (ECN, RFC 3168).
enum class EcnState : std::uint8_t {
  // Too few packets have arrived to tell; they are sent as if it worked.
  kTesting,
  kWorks,
  // Something on the way clears the bits, or the peer's kernel does not show them.
  kBleached,
  // Something on the way makes ECT(0) of ECT(1).
  kRewritten,
  // Every packet comes marked, however slowly they are sent.
  kMangled,
  // Packets that may be marked do not get through.
  kDropped,
};
// "testing", "works", "bleached", "rewritten", "mangled", "dropped".
std::string_view to_string(EcnState state);

enum class LinkRole : std::uint8_t {
  kNormal,
  // Used only for messages whose floors no normal link meets.
  kBackup,
  // Measured, but never used for messages.
  kNever,
};
// "normal", "backup", "never".
std::string_view to_string(LinkRole role);

// What the operator says of a link.
struct LinkTraits {
  LinkRole role = LinkRole::kNormal;
  // Links with a smaller number are preferred; among equals the scores decide.
  int priority = 0;
  // The operator pays per byte: no trains of probes are sent, and the rate is learnt from messages.
  bool metered = false;
  // Nothing is sent faster than this. Default: no limit.
  std::optional<DataRate> rate_cap{};
  // The network is the operator's own, which is worth 0.5 of the security score.
  bool trusted = false;
  friend bool operator==(const LinkTraits&, const LinkTraits&) = default;
};

// A NIC of this host as the endpoint is told of it.
struct LinkInfo {
  // The NIC's name.
  std::string name;
  // The MTU of the IP layer, in bytes. Datagrams never exceed it, so that IP never fragments them.
  std::size_t mtu = 1500;
  LinkTraits traits{};
};

// The measured state behind a Nature, in units. "Up" is from here to the peer, "down" from the peer
// to here. Durations are zero and rates 0 while nothing was measured.
struct LinkState {
  LinkId id{};
  // Messages may be sent: `path` is kOk or kSuspect, and the role is not kNever.
  bool up = false;
  PathState path = PathState::kDead;
  LinkTraits traits{};
  // Packets to this peer are encrypted, which is worth 0.5 of the security score.
  bool encrypted = false;
  // Quantiles of the round trips of the last 2 s, and the smallest of the last 10 s.
  Duration rtt_p50{};
  Duration rtt_p95{};
  Duration rtt_min{};
  // RTTVAR of RFC 6298: how much round trips vary.
  Duration jitter{};
  // How long packets wait in queues each way: their one-way delay above the smallest of 10 s.
  Duration queue_up{};
  Duration queue_down{};
  // The rate that the link delivers each way; down as the peer reports it.
  DataRate rate{};
  // What congestion control leaves us of `rate`, which others may need as well; 0 while `rate` is.
  DataRate share{};
  DataRate rate_down{};
  // The smoothed share of packets lost each way, in [0, 1]; down as the peer reports it.
  double loss = 0;
  double loss_down = 0;
  // Mean number of packets lost in a row; 0 while none was.
  double loss_burst = 0;
  EcnState ecn = EcnState::kTesting;
  // Share of the last 60 s in which the path was not up, in [0, 1].
  double outage = 0;
  // Since the newest evidence of any kind; Duration::max() when the peer was never heard.
  Duration age{};
  // Since the newest evidence of the rate; Duration::max() when there is none.
  Duration rate_age{};
  // How much the evidence is worth, in [0, 1]: 1 when it was measured just now; halves with age
  // (src/core/link/nature.h).
  double confidence = 0;
  // How much evidence there is: round trips behind the quantiles, packets behind the loss, trains
  // of full length behind the rate (at most three count).
  std::uint32_t rtt_samples = 0;
  std::uint32_t loss_packets = 0;
  std::uint32_t rate_trains = 0;
  Nature nature{};

  // The rate to plan with: our share where it is known.
  DataRate usable_rate() const { return share > DataRate{} ? std::min(share, rate) : rate; }
};

// How many links towards one peer are weighed against each other. No measurement behind this value:
// it only has to be larger than the number of NICs of a vehicle. Further links are measured, but
// nothing is planned over them.
inline constexpr std::size_t kMaxLinks = 16;
using Links = Few<LinkState, kMaxLinks>;

}  // namespace interneuron
