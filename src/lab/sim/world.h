// Virtual time: hosts with their own clocks, joined by emulated links, each driving the same
// Endpoint as production.
//
// World time starts at 0 and moves only from event to event, so an hour passes in seconds and the
// same seed gives the same run. At one instant the order is: arrivals, what was planned by at(),
// timeouts. Pure; single-threaded.
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

// A host's clock: local = offset + t + t * drift. Offsets of different hosts differ by anything in
// reality.
struct ClockError {
  Duration offset{};
  std::int64_t drift_ppm = 0;
};

// Faults beside those of the LinkModel, for property tests; probabilities per packet and direction.
struct Faults {
  double loss = 0;
  double duplicate = 0;
  double reorder = 0;  // the packet is delivered up to reorder_by later, past its successors
  Duration reorder_by{};
  bool cut = false;  // nothing passes
};

class World {
 public:
  explicit World(std::uint64_t seed) : rng_(seed) {}

  HostId add_host(EndpointOptions options, const ClockError& clock = {});
  // Joins `a` (the side that profiles call the vehicle: a -> b is "up") and `b`. Both know the link
  // by `link`; `traits` are those of a's NIC.
  void add_link(HostId a, HostId b, LinkId link, const std::string& name, emu::Link model,
                const LinkTraits& traits = {});
  // Host `from` connects to `to` over every link between them.
  PeerId connect(HostId from, HostId to);
  Faults& faults(LinkId link);
  // The emulated link itself, to change it or cut its radio while it runs.
  emu::Link& model(LinkId link);
  const emu::DirectionStats& stats(LinkId link, bool up) const;
  // From now on `host` is seen on `link` with another address, as after a carrier's NAT has
  // forgotten it: what is sent to the old one is lost.
  void rebind(HostId host, LinkId link);

  Endpoint& endpoint(HostId host) { return *hosts_[host].endpoint; }
  TimePoint local_time(HostId host) const { return local(hosts_[host], now_); }
  // Must be called after commands to an endpoint from outside at() and on_event: sends what they
  // queued.
  void flush(HostId host);

  Duration now() const { return now_; }
  void at(Duration when, std::function<void()> action);
  void on_event(std::function<void(HostId, Event&&)> handler) { on_event_ = std::move(handler); }
  // Every datagram that an endpoint hands over, before anything happens to it.
  void on_sent(std::function<void(HostId, LinkId, ByteView)> handler) {
    on_sent_ = std::move(handler);
  }
  // A further delay of each datagram behind its link, asked when an endpoint hands it over. Links
  // stay in order: what follows on the same link and direction waits for it.
  void delay_with(std::function<Duration(HostId, LinkId, ByteView)> delay) {
    delay_ = std::move(delay);
  }
  // From now on the host's clock shows so much more.
  void step_clock(HostId host, Duration by);
  // Runs until world time `end`; everything that happens at `end` is included.
  void run_until(Duration end);

  static Address address_of(HostId host, LinkId link, std::uint8_t mapping = 0);

 private:
  struct Host {
    std::unique_ptr<Endpoint> endpoint;
    ClockError clock;
    std::optional<Duration> wake;  // world time of the endpoint's next timeout
  };
  struct Wire {
    HostId a = 0;
    HostId b = 0;
    LinkId link{};
    emu::Link model;
    Faults faults;
    std::uint8_t mapping_a = 0;  // how often the host was rebound
    std::uint8_t mapping_b = 0;
    std::array<Duration, 2> held_until{};  // by delay_with(), per direction: down, up
  };
  struct InFlight {
    Bytes bytes;
    HostId to = 0;
    Address from{};
    LinkId link{};
    Duration delay{};  // of delay_with()
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
  std::vector<InFlight> in_flight_;  // by tag; those of free tags keep their memory
  std::vector<std::uint64_t> free_tags_;
  std::multimap<Duration, std::function<void()>> planned_;
  std::multimap<Duration, std::uint64_t> late_;  // reordered packets
  std::function<void(HostId, Event&&)> on_event_;
  std::function<void(HostId, LinkId, ByteView)> on_sent_;
  std::function<Duration(HostId, LinkId, ByteView)> delay_;
  Duration now_{};
};

}  // namespace interneuron::sim
