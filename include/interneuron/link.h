// What an endpoint believes of one link towards one peer, as a value: a snapshot for policies,
// plots and tables.
#pragma once

#include <string>

#include "interneuron/nature.h"
#include "interneuron/units.h"

namespace interneuron {

// A NIC of this host as the endpoint is told of it.
struct LinkInfo {
  std::string name;  // the NIC's name
  std::size_t mtu =
      1500;  // of the IP layer, bytes; datagrams never exceed it, so that IP never fragments
};

// The measured state behind a Nature, in units. Durations are zero and rates 0 while nothing was
// measured.
struct LinkState {
  LinkId id{};
  bool up = false;     // heard of within kSilence (src/link/link_estimator.h)
  Duration rtt_p50{};  // of the last 2 s
  Duration rtt_p95{};  // of the last 2 s
  Duration rtt_min{};  // of the last 10 s
  DataRate rate{};     // what the link delivers from here to the peer
  double loss = 0;     // share of packets, smoothed
  Duration age{};      // of the newest evidence
  Nature nature{};     // the scores; security stays 0 until sessions are encrypted
};

}  // namespace interneuron
