// A vehicle and a roadside unit over any links, a stream of messages, and what the paths did.
#pragma once

#include <map>
#include <vector>

#include "core/base/ablation.h"
#include "core/wire/packet.h"
#include "lab/sim/trust.h"
#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim {

using namespace std::chrono_literals;

class Duo {
 public:
  struct Change {
    Duration at{};
    HostId host = 0;
    PathChanged what;
  };

  static PipelineConfig best_link() {
    PipelineConfig pipeline;
    pipeline.stages = {StageKind::kCommunication, StageKind::kCommunication};
    pipeline.policy = "best_link";
    return pipeline;
  }

  explicit Duo(const std::vector<emu::LinkProfile>& profiles, std::uint64_t seed = 1,
               const std::vector<LinkTraits>& traits = {},
               const PipelineConfig& pipeline = best_link(), const Ablation& ablation = {},
               bool is_encrypted = false)
      : world(seed) {
    EndpointOptions o;
    o.session = SessionId{1};
    o.policies = builtin_policies();
    o.pipelines = {pipeline};
    o.ablation = std::make_shared<const Ablation>(ablation);
    if (is_encrypted) o.security = security_of(1, {2});
    vehicle = world.add_host(o);
    if (is_encrypted) o.security = security_of(2, {1});
    o.session = SessionId{2};
    o.pipelines.clear();
    o.accept_peers = true;
    road = world.add_host(o);
    for (std::size_t i = 0; i < profiles.size(); ++i) {
      world.add_link(vehicle, road, LinkId{static_cast<std::uint8_t>(i)}, profiles[i].name,
                     emu::Link(profiles[i], emu::link_seed(seed, i)),
                     i < traits.size() ? traits[i] : LinkTraits{});
    }
    world.on_event([this](HostId host, Event&& event) { handle(host, std::move(event)); });
    world.on_sent([this](HostId host, LinkId link, ByteView bytes) {
      const auto packet = wire::parse(bytes);
      if (packet) sent[{host, link, packet->header.type}] += bytes.size() + kIpUdpBytes;
    });
    peer = world.connect(vehicle, road);
  }

  // One message now; the road answers it.
  void round(std::size_t bytes) { round(Variants{Bytes(bytes)}); }
  void round(Variants variants) {
    Endpoint& e = world.endpoint(vehicle);
    const RoundRef ref = e.begin_round(world.local_time(vehicle), PipelineId{0});
    e.submit(world.local_time(vehicle), ref, std::move(variants), MessageClass::kData, peer);
    world.flush(vehicle);
  }
  // `count` messages from `from` on.
  void stream(Duration from, int count, std::size_t bytes, Duration period = 100ms) {
    for (int i = 0; i < count; ++i) {
      world.at(from + i * period, [this, bytes] { round(bytes); });
    }
  }
  LinkState link(std::uint8_t id, bool at_road = false) {
    const HostId host = at_road ? road : vehicle;
    const PeerId other = at_road ? world.endpoint(road).peers().at(0) : peer;
    for (const LinkState& state : world.endpoint(host).links(world.local_time(host), other)) {
      if (state.id == LinkId{id}) return state;
    }
    return {};
  }
  void change(Duration at, std::uint8_t link, const std::vector<std::string>& keys) {
    world.at(at, [this, link, keys] {
      const auto parsed = emu::parse_change(keys);
      ASSERT_TRUE(std::holds_alternative<emu::LinkChange>(parsed));
      world.change(world.wire_of(LinkId{link}), std::get<emu::LinkChange>(parsed));
    });
  }
  void cut(Duration at, std::uint8_t link, bool is_cut = true) {
    world.at(at, [this, link, is_cut] { world.faults(LinkId{link}).cut = is_cut; });
  }
  // When the path went to `state` at `host`, not before `after`.
  std::optional<Duration> when(HostId host, std::uint8_t link, PathState state, Duration after) {
    for (const Change& c : changes) {
      if (c.host == host && c.at >= after && c.what.link == LinkId{link} && c.what.to == state) {
        return c.at;
      }
    }
    return std::nullopt;
  }
  std::optional<Duration> when_not_ok(HostId host, std::uint8_t link, Duration after) {
    for (const Change& c : changes) {
      if (c.host == host && c.at >= after && c.what.link == LinkId{link} &&
          c.what.to != PathState::kOk) {
        return c.at;
      }
    }
    return std::nullopt;
  }
  std::uint64_t bytes(HostId host, std::uint8_t link, wire::PacketType type) {
    return sent[{host, LinkId{link}, type}];
  }
  int on_time() const {
    int count = 0;
    for (const RoundDone& d : done) count += d.outcome == Outcome::kRemote ? 1 : 0;
    return count;
  }

  World world;
  HostId vehicle = 0;
  HostId road = 0;
  PeerId peer{};
  std::vector<RoundDone> done;
  // What the road was given: when, and which variant.
  std::vector<std::pair<Duration, std::uint8_t>> delivered;
  std::vector<Change> changes;
  std::vector<std::pair<Duration, Planned>> planned;                           // by the vehicle
  std::map<std::tuple<HostId, LinkId, wire::PacketType>, std::uint64_t> sent;  // bytes at IP level

 private:
  void handle(HostId host, Event&& event) {
    if (auto* message = std::get_if<Delivered>(&event)) {
      if (host == road) delivered.emplace_back(world.now(), message->variant);
      world.endpoint(host).submit(world.local_time(host), message->round, {Bytes(kResultBytes)},
                                  MessageClass::kResult);
    } else if (auto* round = std::get_if<RoundDone>(&event)) {
      done.push_back(std::move(*round));
    } else if (auto* change = std::get_if<PathChanged>(&event)) {
      changes.push_back({world.now(), host, std::move(*change)});
    } else if (auto* plan = std::get_if<Planned>(&event); plan != nullptr && host == vehicle) {
      planned.emplace_back(world.now(), std::move(*plan));
    }
  }
};

}  // namespace interneuron::sim
