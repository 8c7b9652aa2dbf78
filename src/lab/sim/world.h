// Hosts in virtual time: each has a clock of its own and drives the same Endpoint as production,
// and emulated links join them.
//
// World time starts at 0 and moves only from event to event, so an hour passes in seconds, and the
// same seed and the same calls give the same run. At one instant the order is: arrivals, what was
// planned by at(), timeouts. Memory grows with the packets that are on their way at once. Handlers
// are called from within run_until() and flush(). Thread-compatible; pure.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "interneuron/endpoint.h"
#include "lab/emu/link.h"

namespace interneuron::sim {

using HostId = std::size_t;

// A host's clock shows offset + t + t * drift at world time t. In reality the offsets of two hosts
// may differ by any amount, and quartz drifts by some 20 ppm.
struct ClockError {
  Duration offset{};
  std::int64_t drift_ppm = 0;
};

// Faults of a link beside those of its LinkModel, for property tests. Probabilities are per packet
// and direction.
struct Faults {
  double loss = 0;
  double duplicate = 0;
  // The packet is delivered up to reorder_by later, so that later ones overtake it.
  double reorder = 0;
  Duration reorder_by{};
  // Nothing passes.
  bool cut = false;
};

class World {
 public:
  explicit World(std::uint64_t seed) : rng_(seed) {}

  HostId add_host(EndpointOptions options, const ClockError& clock = {});
  // Joins two hosts. `a` is the side that profiles call the vehicle: packets from a to b go up.
  // Both hosts know the link by `link`; `traits` are those of a's NIC.
  void add_link(HostId a, HostId b, LinkId link, const std::string& name, emu::Link model,
                const LinkTraits& traits = {});
  // Host `from` connects to `to` over every link between them.
  PeerId connect(HostId from, HostId to);
  Faults& faults(LinkId link);
  // The emulated link itself, to change it or to cut its radio during a run.
  emu::Link& model(LinkId link);
  const emu::DirectionStats& stats(LinkId link, bool up) const;
  // Gives `host` another address on `link`, as a carrier's NAT does that has forgotten the old one.
  // Packets to the old address are lost from now on.
  void rebind(HostId host, LinkId link);

  Endpoint& endpoint(HostId host) { return *hosts_[host].endpoint; }
  TimePoint local_time(HostId host) const { return local(hosts_[host], now_); }
  // Handles the events of the host's endpoint and sends what it has queued. Must be called after
  // commands to an endpoint, except from within on_event().
  void flush(HostId host);

  Duration now() const { return now_; }
  void at(Duration when, std::function<void()> action);
  void on_event(std::function<void(HostId, Event&&)> handler) { on_event_ = std::move(handler); }
  // Shows every datagram that an endpoint hands over, before anything happens to it.
  void on_sent(std::function<void(HostId, LinkId, ByteView)> handler) {
    on_sent_ = std::move(handler);
  }
  // Delays datagrams further, behind their link. `delay` is asked when an endpoint hands a datagram
  // over. Links stay in order: later datagrams of the same link and direction wait for a delayed
  // one.
  void delay_with(std::function<Duration(HostId, LinkId, ByteView)> delay) {
    delay_ = std::move(delay);
  }
  // Sets the host's clock forward by so much from now on, or back if negative.
  void step_clock(HostId host, Duration by);
  // Runs until world time `end`, including everything that happens at that instant.
  void run_until(Duration end);

  static Address address_of(HostId host, LinkId link, std::uint8_t mapping = 0);

 private:
  struct Host {
    std::unique_ptr<Endpoint> endpoint;
    ClockError clock;
    // World time of the endpoint's next timeout.
    std::optional<Duration> wake;
  };
  struct Wire {
    HostId a = 0;
    HostId b = 0;
    LinkId link{};
    emu::Link model;
    Faults faults;
    // How often each host was rebound.
    std::uint8_t mapping_a = 0;
    std::uint8_t mapping_b = 0;
    // Until when delay_with() holds back packets that go down (0) and up (1).
    std::array<Duration, 2> held_until{};
  };
  struct InFlight {
    Bytes bytes;
    HostId to = 0;
    Address from{};
    LinkId link{};
    // What delay_with() asked for.
    Duration delay{};
  };

  static TimePoint local(const Host& host, Duration t);
  static Duration world(const Host& host, TimePoint t);
  Wire& wire(LinkId link);
  void carry(HostId from, const Transmit& transmit, ByteView bytes);
  void put(Wire& wire, bool up, std::uint64_t tag);
  std::uint64_t new_tag();
  std::uint64_t copy_of(std::uint64_t tag);
  void leave(Wire& wire, bool up, emu::LinkModel::Packet packet);
  void deliver(std::uint64_t tag);
  void forget(std::uint64_t tag) { free_tags_.push_back(tag); }
  void plan_wake(Host& host);
  bool chance(double p) { return p > 0 && std::uniform_real_distribution<double>(0, 1)(rng_) < p; }
  Duration next_instant() const;
  void step();

  std::mt19937_64 rng_;
  std::vector<Host> hosts_;
  std::vector<Wire> wires_;
  // By tag. Entries of free tags keep their memory for the next packet.
  std::vector<InFlight> in_flight_;
  std::vector<std::uint64_t> free_tags_;
  std::multimap<Duration, std::function<void()>> planned_;
  // Tags of packets that were delayed or reordered behind their link.
  std::multimap<Duration, std::uint64_t> late_;
  std::function<void(HostId, Event&&)> on_event_;
  std::function<void(HostId, LinkId, ByteView)> on_sent_;
  std::function<Duration(HostId, LinkId, ByteView)> delay_;
  Duration now_{};
};

}  // namespace interneuron::sim
