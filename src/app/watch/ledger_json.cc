#include "app/watch/ledger_json.h"

#include <cmath>

#include "app/watch/json_numbers.h"

namespace interneuron::watch {
namespace {

// Microseconds are exact enough.
double rounded_ms(Duration d) { return std::round(to_ms(d) * 1e3) / 1e3; }

PeerLimit limit_at(std::size_t i) { return static_cast<PeerLimit>(i); }

Json work_json(const computing::PeerWork& work) {
  return {{"waiting", work.waiting},         {"computed", work.computed},
          {"crowded_out", work.crowded_out}, {"too_late", work.too_late},
          {"unreadable", work.unreadable},   {"busy_ms", rounded_ms(work.busy)}};
}

computing::PeerWork work_of(const Json& json) {
  return {.waiting = whole_of<std::size_t>(json.at("waiting")),
          .computed = whole_of<std::uint64_t>(json.at("computed")),
          .crowded_out = whole_of<std::uint64_t>(json.at("crowded_out")),
          .too_late = whole_of<std::uint64_t>(json.at("too_late")),
          .unreadable = whole_of<std::uint64_t>(json.at("unreadable")),
          .busy = from_ms(figure_of(json.at("busy_ms")))};
}

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
          {"struck", std::move(struck)},
          {"work", peer.work ? work_json(*peer.work) : Json()}};
}

LivePeer peer_of(const Json& json) {
  LivePeer peer;
  PeerLedger& l = peer.ledger;
  peer.peer = whole_of<std::uint32_t>(json.at("peer"));
  l.contexts = whole_of<std::size_t>(json.at("contexts"));
  l.pipelines = whole_of<std::size_t>(json.at("pipelines"));
  l.held_messages = whole_of<std::size_t>(json.at("held_messages"));
  l.held_bytes = whole_of<std::size_t>(json.at("held_bytes"));
  l.reassembly_messages = whole_of<std::size_t>(json.at("reassembly_messages"));
  l.reassembly_bytes = whole_of<std::size_t>(json.at("reassembly_bytes"));
  l.longest_lifetime = from_ms(figure_of(json.at("longest_lifetime_ms")));
  for (std::size_t i = 0; i < kPeerLimitCount; ++i) {
    l.strikes[i] =
        whole_of<std::uint64_t>(json.at("struck").at(std::string(to_string(limit_at(i)))));
  }
  const Json& work = json.at("work");
  if (!work.is_null()) peer.work = work_of(work);
  return peer;
}

}  // namespace

Json ledgers_json(Duration loop_stall, const std::vector<LivePeer>& peers) {
  Json json{{"loop_stall_ms", rounded_ms(loop_stall)}, {"peers", Json::array()}};
  for (const LivePeer& peer : peers) json["peers"].push_back(peer_json(peer));
  return json;
}

Duration loop_stall_of(const Json& json) { return from_ms(figure_of(json.at("loop_stall_ms"))); }

std::vector<LivePeer> peers_of(const Json& json) {
  std::vector<LivePeer> peers;
  for (const Json& peer : json.at("peers")) peers.push_back(peer_of(peer));
  return peers;
}

}  // namespace interneuron::watch
