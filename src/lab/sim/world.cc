#include "lab/sim/world.h"

#include <algorithm>
#include <stdexcept>

namespace interneuron::sim {
namespace {

// The MTU of a NIC of which nothing else was said: that of Ethernet.
constexpr std::size_t kEthernetMtu = 1500;
// An address holds three bytes of the host's number.
constexpr HostId kMaxHosts = HostId{1} << 24U;
constexpr std::uint8_t kAddressBytes = 6;

HostId host_of(const Address& address) {
  const auto byte = [&](std::size_t i) { return std::to_integer<HostId>(address.raw[i]); };
  return byte(0) | byte(3) << 8U | byte(4) << 16U;
}

constexpr std::uint64_t route_of(HostId from, LinkId link, HostId to) {
  return std::uint64_t{from} << 40U | std::uint64_t{link.value} << 24U | to;
}

}  // namespace

Address World::address_of(HostId host, LinkId link, std::uint8_t mapping) {
  Address a;
  a.raw[0] = static_cast<std::byte>(host);
  a.raw[1] = static_cast<std::byte>(link.value);
  a.raw[2] = static_cast<std::byte>(mapping);
  a.raw[3] = static_cast<std::byte>(host >> 8U);
  a.raw[4] = static_cast<std::byte>(host >> 16U);
  a.raw[5] = static_cast<std::byte>(link.value >> 8U);
  a.size = kAddressBytes;
  return a;
}

World::World(std::uint64_t seed)
    : rng_(seed),
      late_source_(add_source(Kind::kLate, 0)),
      planned_source_(add_source(Kind::kPlanned, 0)) {}

// The kind stands in the upper half of a source's rank, so that kinds have their turn in order.
Agenda::Source World::add_source(Kind kind, std::size_t index) {
  return agenda_.add(static_cast<std::uint64_t>(kind) << 32U | index);
}

HostId World::add(Host host) {
  const HostId id = hosts_.size();
  if (id == kMaxHosts) throw std::invalid_argument("world: too many hosts");
  host.source = add_source(Kind::kHost, id);
  hosts_.push_back(std::move(host));
  return id;
}

HostId World::add_host(EndpointOptions options, const ClockError& clock) {
  Host host;
  host.clock = clock;
  host.endpoint = std::make_unique<Endpoint>(std::move(options), host.clock.local(now_));
  return add(std::move(host));
}

HostId World::add_foreign(std::unique_ptr<ForeignHost> foreign) {
  Host host;
  host.foreign = std::move(foreign);
  const HostId id = add(std::move(host));
  plan_wake(hosts_[id]);
  return id;
}

std::size_t World::checked(std::size_t index, std::size_t count) {
  if (index >= count) throw std::invalid_argument("world: no such host, link or cell");
  return index;
}

World::Nic* World::nic(Host& host, LinkId link) {
  const auto it = std::ranges::find(host.nics, link, &Nic::link);
  return it == host.nics.end() ? nullptr : &*it;
}

void World::add_nic(HostId id, LinkId link, const LinkInfo& info) {
  Host& host = host_at(id);
  if (Nic* const there = nic(host, link)) {
    there->mtu = info.mtu;
  } else {
    host.nics.push_back({link, info.mtu});
  }
  if (host.endpoint) host.endpoint->add_link(host.clock.local(now_), link, info);
}

WireId World::add_link(HostId a, HostId b, LinkId link, const std::string& name, emu::Link model,
                       const LinkTraits& traits) {
  if (routes_.contains(route_of(a, link, b))) {
    throw std::invalid_argument("world: these hosts have a link of this number");
  }
  for (const HostId host : {a, b}) {
    if (nic(host_at(host), link) != nullptr) continue;
    add_nic(host, link, {name, kEthernetMtu, host == a ? traits : LinkTraits{}});
  }
  const auto id = static_cast<std::uint32_t>(wires_.size());
  wires_.push_back({a, b, link, std::move(model), {}, {}});
  for (const bool up : {true, false}) {
    wires_.back().lanes[up ? 1 : 0].source =
        add_source(Kind::kLane, std::size_t{2} * id + (up ? 0 : 1));
  }
  hosts_[a].wires.push_back(id);
  hosts_[b].wires.push_back(id);
  routes_[route_of(a, link, b)] = routes_[route_of(b, link, a)] = id;
  return WireId{id};
}

CellId World::add_cell(const emu::CellParams& params) {
  const auto id = static_cast<std::uint32_t>(cells_.size());
  cells_.push_back({emu::Cell(params), add_source(Kind::kCell, id)});
  return CellId{id};
}

void World::pass_through(WireId wire, bool up, CellId cell) {
  checked(cell.value, cells_.size());
  wire_at(wire).lanes[up ? 1 : 0].cells.push_back(cell.value);
}

PeerId World::connect(HostId from, HostId to) {
  std::vector<std::pair<LinkId, Address>> addresses;
  for (const std::uint32_t id : host_at(from).wires) {
    const Wire& wire = wires_[id];
    if (wire.a == to || wire.b == to) addresses.emplace_back(wire.link, address_of(to, wire.link));
  }
  const PeerId peer = endpoint(from).connect(local_time(from), addresses);
  flush(from);
  return peer;
}

WireId World::wire_of(LinkId link) const {
  const auto it = std::ranges::find(wires_, link, &Wire::link);
  if (it == wires_.end()) throw std::invalid_argument("world: no such link");
  return WireId{static_cast<std::uint32_t>(it - wires_.begin())};
}

const emu::DirectionStats& World::stats(LinkId link, bool up) const {
  const emu::Link& model = wires_[wire_of(link).value].model;
  return up ? model.up().stats() : model.down().stats();
}

void World::change(WireId id, const emu::LinkChange& change) {
  Wire& wire = wire_at(id);
  wire.model.change(now_, change);
  for (const bool up : {true, false}) plan_lane(wire, up);
}

void World::outage(WireId id, Duration from, Duration length) {
  Wire& wire = wire_at(id);
  wire.model.outage(from, length);
  for (const bool up : {true, false}) plan_lane(wire, up);
}

void World::measure_cells() {
  for (SharedCell& cell : cells_) cell.model.measure_from(now_);
}

void World::rebind(HostId host, LinkId link) {
  Nic* const there = nic(host_at(host), link);
  if (there == nullptr) throw std::invalid_argument("world: no such link");
  ++there->mapping;
}

void World::at(Duration when, std::function<void()> action) {
  planned_.emplace(std::max(when, now_), std::move(action));
  agenda_.set(planned_source_, planned_.begin()->first);
}

// Drains a host: events first (the application answers at once), then what may leave.
void World::flush(HostId id) {
  Host& host = host_at(id);
  if (host.endpoint) {
    poll_endpoint(id);
  } else {
    while (const auto packet = host.foreign->poll_transmit(now_)) {
      carry(id, {packet->link, packet->peer, packet->ip_bytes, packet->ecn, packet->bytes});
    }
  }
  plan_wake(host);
}

void World::poll_endpoint(HostId id) {
  Host& host = hosts_[id];
  while (auto event = host.endpoint->poll_event()) {
    if (on_event_) on_event_(id, std::move(*event));
  }
  std::array<std::byte, kMaxDatagramBytes> buffer;
  while (const auto transmit = host.endpoint->poll_transmit(host.clock.local(now_), buffer)) {
    carry(id, {transmit->link, transmit->to, transmit->size + kIpUdpBytes, Ecn{transmit->ecn},
               std::span(buffer).first(transmit->size), transmit->round});
  }
}

void World::plan_wake(Host& host) {
  std::optional<Duration> wake;
  if (host.foreign) {
    wake = host.foreign->next_timeout(now_);
  } else if (const auto next = host.endpoint->next_timeout()) {
    wake = host.clock.world(*next);
  }
  if (wake) wake = std::max(*wake, now_ + Duration{1});
  agenda_.set(host.source, wake);
}

void World::plan_lane(Wire& wire, bool up) {
  const emu::LinkModel& model = up ? wire.model.up() : wire.model.down();
  agenda_.set(wire.lanes[up ? 1 : 0].source, model.next_delivery());
}

void World::step_clock(HostId host, Duration by) {
  host_at(host).clock.offset += by;
  plan_wake(hosts_[host]);
}

void World::carry(HostId from, const LeavingPacket& out) {
  Host& sender = hosts_[from];
  if (sender.endpoint && on_sent_) on_sent_(from, out.link, out.bytes);
  const HostId to = host_of(out.to);
  const auto route = routes_.find(route_of(from, out.link, to));
  if (route == routes_.end()) return;
  if (out.to != address_of(to, out.link, nic(hosts_[to], out.link)->mapping)) return;
  const Nic& own = *nic(sender, out.link);
  if (out.ip_bytes > own.mtu) {
    ++above_nic_mtu_;
    return;
  }
  Wire& wire = wires_[route->second];
  const bool up = wire.a == from;
  const std::uint64_t tag = packets_.add();
  PacketOnItsWay& packet = packets_[tag];
  packet.bytes.assign(out.bytes.begin(), out.bytes.end());
  packet.ip_bytes = out.ip_bytes;
  packet.ecn = out.ecn;
  packet.from = address_of(from, out.link, own.mapping);
  packet.wire = route->second;
  packet.up = up;
  packet.passed = 0;
  packet.delay = sender.endpoint && delay_ ? delay_(from, out) : Duration{};
  if (chance(wire.faults.duplicate)) put(wire, up, packets_.copy(tag));
  put(wire, up, tag);
}

void World::put(Wire& wire, bool up, std::uint64_t tag) {
  emu::LinkModel& model = up ? wire.model.up() : wire.model.down();
  Ecn& ecn = packets_[tag].ecn;
  const bool is_dropped = wire.faults.drops_ect && emu::is_ect(ecn);
  if (wire.faults.ecn && emu::is_ect(ecn)) ecn = *wire.faults.ecn;
  const bool vanishes = wire.faults.cut || is_dropped || chance(wire.faults.loss);
  if (vanishes || !model.enqueue(now_, packets_[tag].ip_bytes, tag)) packets_.release(tag);
  plan_lane(wire, up);
}

// A packet has come through the link itself.
void World::leave_link(emu::LinkModel::Packet packet) {
  // A corrupt packet is lost too, since the receiving host's checksum sees the flipped bit.
  if (packet.lost || packet.corrupt) {
    if (packet.last) packets_.release(packet.tag);
    return;
  }
  leave_hop(packet.last ? packet.tag : packets_.copy(packet.tag));
}

// A packet has come through the link or a cell, and goes to the next cell or to its receiver.
void World::leave_hop(std::uint64_t tag) {
  PacketOnItsWay& packet = packets_[tag];
  Wire& wire = wires_[packet.wire];
  Lane& lane = wire.lanes[packet.up ? 1 : 0];
  if (packet.passed < lane.cells.size()) {
    SharedCell& cell = cells_[lane.cells[packet.passed++]];
    if (!cell.model.enqueue(now_, {tag, packet.wire, packet.ip_bytes, packet.ecn})) {
      packets_.release(tag);
    }
    agenda_.set(cell.source, cell.model.next_departure());
    return;
  }
  Duration by = packet.delay;
  const bool waits = by > Duration{} || lane.held_until >= now_;
  if (waits) {
    by = std::max(by, lane.held_until - now_);
    lane.held_until = now_ + by;
  }
  if (chance(wire.faults.reorder)) {
    by += Duration{std::uniform_int_distribution<std::int64_t>(
        1, std::max<std::int64_t>(1, wire.faults.reorder_by.count()))(rng_)};
  }
  if (!waits && by == Duration{}) return deliver(tag);
  late_.emplace(now_ + by, tag);
  agenda_.set(late_source_, late_.begin()->first);
}

void World::deliver(std::uint64_t tag) {
  PacketOnItsWay& packet = packets_[tag];
  const Wire& wire = wires_[packet.wire];
  const HostId to = packet.up ? wire.b : wire.a;
  Host& host = hosts_[to];
  if (host.endpoint) {
    host.endpoint->handle_datagram(host.clock.local(now_), {wire.link, packet.from, packet.bytes,
                                                            static_cast<std::uint8_t>(packet.ecn)});
  } else {
    shown_.link = wire.link;
    shown_.peer = packet.from;
    shown_.ip_bytes = packet.ip_bytes;
    shown_.ecn = packet.ecn;
    shown_.bytes.swap(packet.bytes);
    host.foreign->handle_packet(now_, shown_);
  }
  packets_.release(tag);
  flush(to);
}

void World::serve(Kind kind, std::uint32_t index) {
  switch (kind) {
    case Kind::kLane:
      return serve_lane(wires_[index / 2], index % 2 == 0);
    case Kind::kCell:
      return serve_cell(cells_[index]);
    case Kind::kLate:
      return serve_late();
    case Kind::kPlanned:
      return serve_planned();
    case Kind::kHost:
      return serve_host(index);
  }
}

void World::serve_lane(Wire& wire, bool up) {
  emu::LinkModel& model = up ? wire.model.up() : wire.model.down();
  while (const auto packet = model.dequeue(now_)) leave_link(*packet);
  plan_lane(wire, up);
}

void World::serve_cell(SharedCell& cell) {
  while (const auto departed = cell.model.dequeue(now_)) {
    const emu::Cell::Packet& packet = departed->packet;
    if (departed->dropped) {
      packets_.release(packet.tag);
      continue;
    }
    packets_[packet.tag].ecn = packet.ecn;
    leave_hop(packet.tag);
  }
  agenda_.set(cell.source, cell.model.next_departure());
}

void World::serve_late() {
  while (!late_.empty() && late_.begin()->first <= now_) {
    const std::uint64_t tag = late_.begin()->second;
    late_.erase(late_.begin());
    deliver(tag);
  }
  if (!late_.empty()) agenda_.set(late_source_, late_.begin()->first);
}

void World::serve_planned() {
  while (!planned_.empty() && planned_.begin()->first <= now_) {
    const auto action = std::move(planned_.begin()->second);
    planned_.erase(planned_.begin());
    action();
  }
  if (!planned_.empty()) agenda_.set(planned_source_, planned_.begin()->first);
}

void World::serve_host(HostId id) {
  Host& host = hosts_[id];
  if (host.endpoint) {
    host.endpoint->handle_timeout(host.clock.local(now_));
  } else {
    host.foreign->handle_timeout(now_);
  }
  flush(id);
}

void World::run_until(Duration end) {
  while (const auto next = agenda_.next()) {
    if (*next > end) break;
    now_ = std::max(now_, *next);
    const std::uint64_t rank = agenda_.take();
    serve(static_cast<Kind>(rank >> 32U), static_cast<std::uint32_t>(rank));
  }
  agenda_.finish();
  now_ = std::max(now_, end);
}

}  // namespace interneuron::sim
