// Made-up links for the tests of what shows them.
#pragma once

#include <string>

#include "app/watch/row.h"

namespace interneuron::watch {

inline NicFacts made_up_nic(const std::string& name, const std::string& address,
                            NicState state = NicState::kReady) {
  NicFacts facts;
  facts.nic.name = name;
  facts.nic.index = 7;
  facts.nic.kind = "wwan";
  facts.nic.driver = "qmi_wwan";
  facts.nic.operstate = "up";
  facts.nic.mac = "02:00:00:00:00:01";
  facts.nic.mtu = 1428;
  if (!address.empty()) {
    facts.nic.addresses = {*make_address(address, 0)};
    facts.nic.gateways = {*make_address("10.0.0.1", 0)};
  }
  facts.state = state;
  facts.reason = state == NicState::kReady ? "ready" : "carrier lost";
  return facts;
}

inline Measured made_up_figures(double rtt_ms = 20, double mbit = 50) {
  Measured m;
  m.program = "vehicle";
  m.peer = 1;
  m.state.up = true;
  m.state.path = PathState::kOk;
  m.state.traits = {.role = LinkRole::kBackup,
                    .priority = 2,
                    .metered = true,
                    .rate_cap = DataRate::mbit(20),
                    .trusted = true};
  m.state.rtt_p50 = from_ms(rtt_ms);
  m.state.rtt_p95 = from_ms(rtt_ms * 1.5);
  m.state.rtt_min = from_ms(rtt_ms * 0.9);
  m.state.jitter = from_ms(1.5);
  m.state.queue_up = from_ms(2);
  m.state.rate = DataRate::mbit(mbit);
  m.state.rate_down = DataRate::mbit(mbit * 2);
  m.state.loss = 0.013;
  m.state.loss_burst = 1.5;
  m.state.age = from_ms(120);
  m.state.rate_age = from_ms(2500);
  m.state.confidence = 0.75;
  m.state.nature = {.delay = 1, .bandwidth = 0.5, .reliability = 0.25, .security = 0};
  m.path_reason = "feedback is back";
  m.counters.duplicate_packets = 5;
  m.counters.malformed_packets = 6;
  m.counters.other_version_packets = 7;
  m.counters.other_packets = 8;
  m.counters.refused_packets = 9;
  m.counters.sent_packets = 100;
  m.counters.received_packets = 90;
  m.counters.sent_bytes = 1000;
  m.counters.received_bytes = 900;
  m.counters.handshake_packets = 3;
  m.counters.unauthentic_packets = 4;
  return m;
}

inline LinksSnapshot made_up_snapshot() {
  LinksSnapshot s;
  s.at = TimePoint{from_ms(100'000)};
  s.unix_ms = 1'700'000'000'000;
  s.source = "measured by vehicle (process 7)";
  s.rows = {{made_up_nic("wwan0", "10.0.0.2"), made_up_figures()},
            {made_up_nic("wwan1", "", NicState::kNoCarrier), std::nullopt}};
  LivePeer peer{.peer = 4, .ledger = {}};
  peer.ledger.contexts = 3;
  peer.ledger.held_messages = 2;
  peer.ledger.held_bytes = 5000;
  peer.ledger.reassembly_messages = 1;
  peer.ledger.reassembly_bytes = 12'000;
  peer.ledger.longest_lifetime = from_ms(10'000);
  peer.ledger.strikes[static_cast<std::size_t>(PeerLimit::kOrigin)] = 7;
  peer.work = computing::PeerWork{.waiting = 1,
                                  .computed = 340,
                                  .crowded_out = 2,
                                  .too_late = 3,
                                  .unreadable = 4,
                                  .busy = from_ms(12'340)};
  s.programs = {{"vehicle", 7, from_ms(4.5), {peer, {.peer = 5, .ledger = {}}}}};
  s.events = {{TimePoint{from_ms(95'000)}, "wwan1", "ready", "no_carrier", "carrier lost"}};
  return s;
}

}  // namespace interneuron::watch
