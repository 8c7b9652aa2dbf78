// Whatever the topology and the load: every packet that a foreign host hands over arrives once, or
// is counted where it was lost; each flow stays in order; and no packet above an MTU arrives.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <memory>
#include <vector>

#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim::world_property_test {
namespace {

constexpr LinkId kLink{0};
constexpr std::size_t kNicMtu = 1400;
constexpr std::size_t kHopMtu = 1200;

// Sends numbered packets of random sizes at random times to one peer, and notes what arrives.
class Chatter : public ForeignHost {
 public:
  Chatter(Address to, std::vector<std::pair<Duration, std::size_t>> plan)
      : to_(to), plan_(std::move(plan)) {}

  void handle_packet(Duration, const ForeignPacket& packet) override {
    const auto number = std::to_integer<int>(packet.bytes.at(0));
    const auto from = std::to_integer<int>(packet.peer.raw[0]);
    in_order = in_order && (!newest_.contains(from) || newest_[from] < number);
    newest_[from] = number;
    largest = std::max(largest, packet.ip_bytes);
    ++arrived;
  }
  void handle_timeout(Duration) override {}
  std::optional<ForeignPacket> poll_transmit(Duration now) override {
    if (sent == plan_.size() || now < plan_[sent].first) return std::nullopt;
    const std::size_t bytes = plan_[sent].second;
    return ForeignPacket{kLink, to_, bytes, Ecn::kNotEct, {static_cast<std::byte>(sent++)}};
  }
  std::optional<Duration> next_timeout(Duration) const override {
    if (sent == plan_.size()) return std::nullopt;
    return plan_[sent].first;
  }

  std::size_t sent = 0;
  std::size_t arrived = 0;
  std::size_t largest = 0;
  bool in_order = true;

 private:
  Address to_;
  std::vector<std::pair<Duration, std::size_t>> plan_;
  std::map<int, int> newest_;
};

std::vector<std::pair<Duration, std::size_t>> some_plan() {
  std::vector<std::pair<Duration, std::size_t>> plan;
  Duration at{};
  const int count = *rc::gen::inRange(0, 60);
  for (int i = 0; i < count; ++i) {
    at += std::chrono::microseconds(*rc::gen::inRange(0, 3000));
    plan.emplace_back(at, *rc::gen::inRange<std::size_t>(40, 1501));
  }
  return plan;
}

emu::CellParams some_cell() {
  emu::CellParams params{.rate = DataRate::mbit(*rc::gen::element(1.0, 8.0, 100.0)),
                         .queue_bytes = *rc::gen::element<std::size_t>(2000, 50'000),
                         .mtu = kHopMtu};
  if (*rc::gen::arbitrary<bool>()) params.codel = emu::CoDelParams{1ms, 10ms};
  return params;
}

RC_GTEST_PROP(WorldProperty, PacketsArriveOnceOrAreCounted, ()) {
  World world(*rc::gen::arbitrary<std::uint64_t>());
  const std::size_t cells = *rc::gen::inRange<std::size_t>(1, 4);
  for (std::size_t i = 0; i < cells; ++i) world.add_cell(some_cell());
  std::vector<Chatter*> hosts;
  const auto add = [&](Address to, auto plan) {
    auto host = std::make_unique<Chatter>(to, std::move(plan));
    hosts.push_back(host.get());
    const HostId id = world.add_foreign(std::move(host));
    world.add_nic(id, kLink, {"nic", kNicMtu});
    return id;
  };
  const HostId sink = add({}, std::vector<std::pair<Duration, std::size_t>>{});
  std::vector<WireId> wires;
  const std::size_t talkers = *rc::gen::inRange<std::size_t>(1, 6);
  for (std::size_t i = 0; i < talkers; ++i) {
    const HostId from = add(World::address_of(sink, kLink), some_plan());
    const emu::LinkProfile profile = constant_link("l", *rc::gen::inRange(0, 80), 20, 20);
    wires.push_back(world.add_link(from, sink, kLink, "l", emu::Link(profile, i)));
    const std::size_t hops = *rc::gen::inRange<std::size_t>(1, 3);
    for (std::size_t hop = 0; hop < hops; ++hop) {
      const auto cell = *rc::gen::inRange<std::size_t>(0, cells);
      world.pass_through(wires.back(), true, CellId{static_cast<std::uint32_t>(cell)});
    }
  }
  world.run_until(1min);

  std::size_t sent = 0;
  for (const Chatter* host : hosts) sent += host->sent;
  std::uint64_t lost = world.above_nic_mtu();
  for (const WireId wire : wires) {
    const emu::DirectionStats& s = world.model(wire).up().stats();
    lost += s.lost + s.queue_drops + s.too_big;
  }
  for (std::uint32_t i = 0; i < cells; ++i) {
    const emu::CellStats& s = world.cell(CellId{i}).stats();
    lost += s.queue_drops + s.codel_drops + s.too_big;
    RC_ASSERT(s.packets_in == s.delivered + s.queue_drops + s.codel_drops + s.too_big);
  }
  RC_ASSERT(hosts[0]->arrived + lost == sent);
  RC_ASSERT(hosts[0]->in_order);
  RC_ASSERT(hosts[0]->largest <= kHopMtu);
}

}  // namespace
}  // namespace interneuron::sim::world_property_test
