// A vehicle and a roadside unit that answers each round at once, and what the paths did.
#pragma once

#include <map>
#include <vector>

#include "core/base/ablation.h"
#include "core/wire/packet.h"
#include "lab/sim/duo.h"
#include "lab/sim/trust.h"
#include "support.h"

namespace interneuron::sim {

class EchoDuo : public Duo {
 public:
  static PipelineConfig best_link() {
    return PipelineConfig{.stages = {StageKind::kCommunication, StageKind::kCommunication},
                          .policy = "best_link"};
  }

  explicit EchoDuo(const std::vector<emu::LinkProfile>& profiles, std::uint64_t seed = 1,
                   const std::vector<LinkTraits>& traits = {},
                   const PipelineConfig& pipeline = best_link(), const Ablation& ablation = {},
                   bool is_encrypted = false)
      : Duo(profiles, {.traits = traits, .seed = seed},
            endpoint({pipeline}, ablation, is_encrypted ? security_of(1, {2}) : nullptr),
            endpoint({}, ablation, is_encrypted ? security_of(2, {1}) : nullptr)) {
    world.on_sent([this](HostId host, LinkId link, ByteView bytes) {
      const auto packet = wire::parse(bytes);
      if (packet) sent[{host, link, packet->header.type}] += bytes.size() + kIpUdpBytes;
    });
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
  // When the path went to `state` at `host`, or to any that is not kOk, not before `after`.
  std::optional<Duration> when(HostId host, std::uint8_t link, PathState state, Duration after) {
    return first(host, link, after, [state](PathState to) { return to == state; });
  }
  std::optional<Duration> when_not_ok(HostId host, std::uint8_t link, Duration after) {
    return first(host, link, after, [](PathState to) { return to != PathState::kOk; });
  }
  std::uint64_t bytes(HostId host, std::uint8_t link, wire::PacketType type) {
    return sent[{host, LinkId{link}, type}];
  }
  int on_time() const {
    return static_cast<int>(std::ranges::count(done, Outcome::kRemote, &RoundDone::outcome));
  }

  std::vector<RoundDone> done;
  // What the road was given: when, and which variant.
  std::vector<std::pair<Duration, std::uint8_t>> delivered;
  std::vector<std::pair<Duration, Planned>> planned;                           // by the vehicle
  std::map<std::tuple<HostId, LinkId, wire::PacketType>, std::uint64_t> sent;  // bytes at IP level

 private:
  static EndpointOptions endpoint(std::vector<PipelineConfig> pipelines, const Ablation& ablation,
                                  std::shared_ptr<const Security> security) {
    EndpointOptions o;
    o.pipelines = std::move(pipelines);
    o.ablation = std::make_shared<const Ablation>(ablation);
    o.security = std::move(security);
    return o;
  }
  template <class Is>
  std::optional<Duration> first(HostId host, std::uint8_t link, Duration after, const Is& is) {
    for (const Change& c : changes) {
      const bool is_there = c.host == host && c.what.link == LinkId{link};
      if (is_there && c.at >= after && is(c.what.to)) return c.at;
    }
    return std::nullopt;
  }
  void handle(HostId host, Event&& event) override {
    if (auto* message = std::get_if<Delivered>(&event)) {
      if (host == road) delivered.emplace_back(world.now(), message->variant);
      world.endpoint(host).submit(world.local_time(host), message->round, {Bytes(kResultBytes)},
                                  MessageClass::kResult);
    } else if (auto* round = std::get_if<RoundDone>(&event)) {
      done.push_back(std::move(*round));
    } else if (auto* plan = std::get_if<Planned>(&event); plan != nullptr && host == vehicle) {
      planned.emplace_back(world.now(), std::move(*plan));
    } else if (!std::holds_alternative<Message>(event)) {
      Duo::handle(host, std::move(event));
    }
  }
};

}  // namespace interneuron::sim
