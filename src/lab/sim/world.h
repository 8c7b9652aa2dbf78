// Hosts in virtual time: each has a clock of its own and drives the same Endpoint as production, or
// is a ForeignHost, and emulated links join them, which may share cells.
//
// A packet's way from one host to another, the same in both directions:
//
//   MTU of the sender's NIC -> loss and duplication of Faults -> the link's own LinkModel (MTU,
//   NAT, queue, bottleneck, loss, delay) -> the cells of this direction, one after the other ->
//   delays of delay_with() and Faults -> the receiver
//
// What the LinkModel loses therefore does not use the cells, and what a LinkModel spreads in time
// enters them so spread. A link whose own bottleneck is to play no part has a rate far above that
// of its cells.
//
// World time starts at 0 and moves only from event to event, so an hour passes in seconds, and the
// same seed and the same calls give the same run. At one instant the order is: arrivals (from links
// in the order of add_link(), up before down, then from cells, then what was delayed), what was
// planned by at(), timeouts in the order of hosts. An event costs O(log n) with n hosts and links.
// Memory grows with the packets that are on their way at once. Handlers are called from within
// run_until() and flush(). Errors: std::invalid_argument for a host, link or cell that does not
// exist, and for a second link between two hosts with the same LinkId. Thread-compatible; pure.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <unordered_map>
#include <vector>

#include "interneuron/endpoint.h"
#include "lab/emu/cell.h"
#include "lab/emu/link.h"
#include "lab/sim/agenda.h"
#include "lab/sim/host.h"

namespace interneuron::sim {

class World {
 public:
  explicit World(std::uint64_t seed);
  HostId add_host(EndpointOptions options, const ClockError& clock = {});
  HostId add_foreign(std::unique_ptr<ForeignHost> host);
  // A NIC, if it differs from those of add_link(). Packets larger than its MTU do not leave it.
  void add_nic(HostId host, LinkId link, const LinkInfo& info);
  // Joins two hosts. `a` is the side that profiles call the vehicle: packets from a to b go up.
  // Both hosts know it by `link`, the number of a NIC of each, which may have links to several
  // hosts; a NIC that is not there yet is added, with 1500 bytes and, at a, `traits`.
  WireId add_link(HostId a, HostId b, LinkId link, const std::string& name, emu::Link model,
                  const LinkTraits& traits = {});
  // A bottleneck that links may share, in one direction or both.
  CellId add_cell(const emu::CellParams& params);
  // Packets of this link and direction go through the cell too, after those named before.
  void pass_through(WireId wire, bool up, CellId cell);
  // Host `from` connects to `to` over every link between them.
  PeerId connect(HostId from, HostId to);

  // The first link that hosts know by this number; most worlds have one.
  WireId wire_of(LinkId link) const;
  Faults& faults(WireId wire) { return wire_at(wire).faults; }
  Faults& faults(LinkId link) { return faults(wire_of(link)); }
  const emu::Link& model(WireId wire) const {
    return wires_[checked(wire.value, wires_.size())].model;
  }
  const emu::DirectionStats& stats(LinkId link, bool up) const;
  // Changes an emulated link, or cuts its radio in [from, from + length), which may lie ahead.
  void change(WireId wire, const emu::LinkChange& change);
  void outage(WireId wire, Duration from, Duration length);
  const emu::Cell& cell(CellId cell) const {
    return cells_[checked(cell.value, cells_.size())].model;
  }
  // The time of queues and the utilisation of all cells begin anew: what was before is a warm-up.
  void measure_cells();
  // Packets that were larger than the MTU of the NIC that was to send them, of all hosts.
  std::uint64_t above_nic_mtu() const { return above_nic_mtu_; }
  // Gives `host` another address on `link`, as a carrier's NAT does that has forgotten the old one.
  // Packets to the old address are lost from now on.
  void rebind(HostId host, LinkId link);

  // Not of a foreign host.
  Endpoint& endpoint(HostId host) { return *hosts_[host].endpoint; }
  TimePoint local_time(HostId host) const { return hosts_[host].clock.local(now_); }
  // Handles the events of the host's endpoint and sends what it has queued. Must be called after
  // commands to an endpoint, except from within on_event(), and to a foreign host.
  void flush(HostId host);

  Duration now() const { return now_; }
  void at(Duration when, std::function<void()> action);
  void on_event(std::function<void(HostId, Event&&)> handler) { on_event_ = std::move(handler); }
  // Shows every datagram that an endpoint hands over, before anything happens to it.
  void on_sent(std::function<void(HostId, LinkId, ByteView)> handler) {
    on_sent_ = std::move(handler);
  }
  // Delays datagrams behind their link; `delay` is asked when an endpoint hands one over. Links
  // stay in order: later datagrams of the same link and direction wait for a delayed one.
  void delay_with(std::function<Duration(HostId, const LeavingPacket&)> delay) {
    delay_ = std::move(delay);
  }
  // Sets the host's clock forward by so much from now on, or back if negative.
  void step_clock(HostId host, Duration by);
  // Runs until world time `end`, including everything that happens at that instant.
  void run_until(Duration end);

  static Address address_of(HostId host, LinkId link, std::uint8_t mapping = 0);

 private:
  struct Nic {
    LinkId link{};
    std::size_t mtu = 0;
    // How often the NIC was rebound.
    std::uint8_t mapping = 0;
  };
  struct Host {
    // Either of the two.
    std::unique_ptr<Endpoint> endpoint;
    std::unique_ptr<ForeignHost> foreign;
    ClockError clock;
    std::vector<Nic> nics;
    // Links of which it is an end, in the order of their numbers.
    std::vector<std::uint32_t> wires;
    Agenda::Source source = 0;
  };
  // One direction of a wire.
  struct Lane {
    Agenda::Source source = 0;
    std::vector<std::uint32_t> cells;
    // Until when delay_with() holds back packets.
    Duration held_until{-1};
  };
  struct Wire {
    HostId a = 0;
    HostId b = 0;
    LinkId link{};
    emu::Link model;
    Faults faults;
    // Down (0) and up (1).
    std::array<Lane, 2> lanes{};
  };
  struct SharedCell {
    emu::Cell model;
    Agenda::Source source = 0;
  };
  // What may happen at an instant, in the order in which it does.
  enum class Kind : std::uint8_t { kLane, kCell, kLate, kPlanned, kHost };

  HostId add(Host host);
  static std::size_t checked(std::size_t index, std::size_t count);
  Host& host_at(HostId host) { return hosts_[checked(host, hosts_.size())]; }
  Wire& wire_at(WireId wire) { return wires_[checked(wire.value, wires_.size())]; }
  Agenda::Source add_source(Kind kind, std::size_t index);
  static Nic* nic(Host& host, LinkId link);
  void plan_lane(Wire& wire, bool up);
  void plan_wake(Host& host);
  void poll_endpoint(HostId id);
  void carry(HostId from, const LeavingPacket& out);
  void put(Wire& wire, bool up, std::uint64_t tag);
  void leave_link(emu::LinkModel::Packet packet);
  void leave_hop(std::uint64_t tag);
  void deliver(std::uint64_t tag);
  bool chance(double p) { return p > 0 && std::uniform_real_distribution<double>(0, 1)(rng_) < p; }
  void serve(Kind kind, std::uint32_t index);
  void serve_lane(Wire& wire, bool up);
  void serve_cell(SharedCell& cell);
  void serve_late();
  void serve_planned();
  void serve_host(HostId id);

  std::mt19937_64 rng_;
  // Their members stay where they are when a handler adds one.
  std::deque<Host> hosts_;
  std::deque<Wire> wires_;
  std::deque<SharedCell> cells_;
  // The wire by sender, LinkId and receiver.
  std::unordered_map<std::uint64_t, std::uint32_t> routes_;
  Agenda agenda_;
  Agenda::Source late_source_;
  Agenda::Source planned_source_;
  Packets packets_;
  // What a foreign host is shown.
  ForeignPacket shown_;
  std::multimap<Duration, std::function<void()>> planned_;
  // Tags of packets that were delayed or reordered behind their link.
  std::multimap<Duration, std::uint64_t> late_;
  std::function<void(HostId, Event&&)> on_event_;
  std::function<void(HostId, LinkId, ByteView)> on_sent_;
  std::function<Duration(HostId, const LeavingPacket&)> delay_;
  std::uint64_t above_nic_mtu_ = 0;
  Duration now_{};
};

}  // namespace interneuron::sim
