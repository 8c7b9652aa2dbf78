#include "app/watch/ledger_json.h"

#include <cmath>

namespace interneuron::cli {
namespace {

// Microseconds are exact enough.
double rounded_ms(Duration d) { return std::round(to_ms(d) * 1e3) / 1e3; }

PeerLimit limit_at(std::size_t i) { return static_cast<PeerLimit>(i); }

Json peer_json(const LivePeer& peer) {
  const PeerLedger& l = peer.ledger;
  Json struck = Json::object();
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    struck[std::string(to_string(limit_at(i)))] = l.strikes[i];
  }
  return {{"peer", peer.peer},
          {"contexts", l.contexts},
          {"pipelines", l.pipelines},
          {"held_messages", l.held_messages},
          {"held_bytes", l.held_bytes},
          {"reassembly_messages", l.reassembly_messages},
          {"reassembly_bytes", l.reassembly_bytes},
          {"longest_lifetime_ms", rounded_ms(l.longest_lifetime)},
          {"struck", std::move(struck)}};
}

LivePeer peer_of(const Json& json) {
  LivePeer peer;
  PeerLedger& l = peer.ledger;
  peer.peer = json.at("peer").get<std::uint32_t>();
  l.contexts = json.at("contexts").get<std::size_t>();
  l.pipelines = json.at("pipelines").get<std::size_t>();
  l.held_messages = json.at("held_messages").get<std::size_t>();
  l.held_bytes = json.at("held_bytes").get<std::size_t>();
  l.reassembly_messages = json.at("reassembly_messages").get<std::size_t>();
  l.reassembly_bytes = json.at("reassembly_bytes").get<std::size_t>();
  l.longest_lifetime = from_ms(json.at("longest_lifetime_ms").get<double>());
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    l.strikes[i] = json.at("struck").at(std::string(to_string(limit_at(i)))).get<std::uint64_t>();
  }
  return peer;
}

}  // namespace

Json ledgers_json(Duration loop_stall, const std::vector<LivePeer>& peers) {
  Json json{{"loop_stall_ms", rounded_ms(loop_stall)}, {"peers", Json::array()}};
  for (const LivePeer& peer : peers) json["peers"].push_back(peer_json(peer));
  return json;
}

Duration loop_stall_of(const Json& json) { return from_ms(json.at("loop_stall_ms").get<double>()); }

std::vector<LivePeer> peers_of(const Json& json) {
  std::vector<LivePeer> peers;
  for (const Json& peer : json.at("peers")) peers.push_back(peer_of(peer));
  return peers;
}

}  // namespace interneuron::cli
