#include "lab/sim/world.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "core/wire/packet.h"

namespace interneuron::sim {
namespace {

constexpr std::int64_t kMillion = 1'000'000;

}  // namespace

Address World::address_of(HostId host, LinkId link, std::uint8_t mapping) {
  Address a;
  a.raw[0] = static_cast<std::byte>(host);
  a.raw[1] = static_cast<std::byte>(link.value);
  a.raw[2] = static_cast<std::byte>(mapping);
  a.size = 3;
  return a;
}

TimePoint World::local(const Host& host, Duration t) {
  return TimePoint{host.clock.offset + t +
                   Duration{t.count() / kMillion * host.clock.drift_ppm +
                            t.count() % kMillion * host.clock.drift_ppm / kMillion}};
}

// The first instant of world time at which the host's clock has reached `t`.
Duration World::world(const Host& host, TimePoint t) {
  const std::int64_t elapsed = (t.time_since_epoch() - host.clock.offset).count();
  const auto guess =
      static_cast<std::int64_t>(static_cast<long double>(elapsed) * kMillion /
                                static_cast<long double>(kMillion + host.clock.drift_ppm));
  Duration w{guess - 2};
  while (local(host, w) < t) w += Duration{1};
  return w;
}

HostId World::add_host(EndpointOptions options, const ClockError& clock) {
  Host host;
  host.clock = clock;
  host.endpoint = std::make_unique<Endpoint>(std::move(options), local(host, now_));
  hosts_.push_back(std::move(host));
  return hosts_.size() - 1;
}

void World::add_link(HostId a, HostId b, LinkId link, const std::string& name, emu::Link model,
                     const LinkTraits& traits) {
  wires_.push_back({a, b, link, std::move(model), {}, 0, 0, {Duration{-1}, Duration{-1}}});
  hosts_[a].endpoint->add_link(local_time(a), link, {name, 1500, traits});
  hosts_[b].endpoint->add_link(local_time(b), link, {name, 1500, {}});
}

PeerId World::connect(HostId from, HostId to) {
  std::vector<std::pair<LinkId, Address>> addresses;
  for (const Wire& wire : wires_) {
    const bool joins = (wire.a == from && wire.b == to) || (wire.a == to && wire.b == from);
    if (joins) addresses.emplace_back(wire.link, address_of(to, wire.link));
  }
  const PeerId peer = hosts_[from].endpoint->connect(local_time(from), addresses);
  flush(from);
  return peer;
}

World::Wire& World::wire(LinkId link) {
  const auto it = std::ranges::find(wires_, link, &Wire::link);
  if (it == wires_.end()) throw std::invalid_argument("world: no such link");
  return *it;
}

Faults& World::faults(LinkId link) { return wire(link).faults; }

emu::Link& World::model(LinkId link) { return wire(link).model; }

const emu::DirectionStats& World::stats(LinkId link, bool up) const {
  const auto it = std::ranges::find(wires_, link, &Wire::link);
  if (it == wires_.end()) throw std::invalid_argument("world: no such link");
  return up ? it->model.up().stats() : it->model.down().stats();
}

void World::rebind(HostId host, LinkId link) {
  Wire& w = wire(link);
  ++(w.a == host ? w.mapping_a : w.mapping_b);
}

void World::at(Duration when, std::function<void()> action) {
  planned_.emplace(std::max(when, now_), std::move(action));
}

// Drains an endpoint: events first (the application answers at once), then what may leave.
void World::flush(HostId id) {
  Host& host = hosts_[id];
  while (auto event = host.endpoint->poll_event()) {
    if (on_event_) on_event_(id, std::move(*event));
  }
  std::array<std::byte, kMaxDatagramBytes> buffer;
  while (const auto transmit = host.endpoint->poll_transmit(local(host, now_), buffer)) {
    carry(id, *transmit, std::span(buffer).first(transmit->size));
  }
  plan_wake(host);
}

void World::plan_wake(Host& host) {
  const auto next = host.endpoint->next_timeout();
  host.wake.reset();
  if (next) host.wake = std::max(world(host, *next), now_ + Duration{1});
}

void World::step_clock(HostId host, Duration by) {
  hosts_[host].clock.offset += by;
  plan_wake(hosts_[host]);
}

void World::carry(HostId from, const Transmit& transmit, ByteView bytes) {
  if (on_sent_) on_sent_(from, transmit.link, bytes);
  const auto it = std::ranges::find(wires_, transmit.link, &Wire::link);
  if (it == wires_.end()) return;
  const bool up = it->a == from;
  const HostId to = up ? it->b : it->a;
  if (transmit.to != address_of(to, it->link, up ? it->mapping_b : it->mapping_a)) return;
  const std::uint64_t tag = new_tag();
  InFlight& packet = in_flight_[tag];
  packet.bytes.assign(bytes.begin(), bytes.end());
  packet.to = to;
  packet.from = address_of(from, it->link, up ? it->mapping_a : it->mapping_b);
  packet.link = it->link;
  packet.delay = delay_ ? delay_(from, it->link, bytes) : Duration{};
  if (chance(it->faults.duplicate)) put(*it, up, copy_of(tag));
  put(*it, up, tag);
}

std::uint64_t World::new_tag() {
  if (free_tags_.empty()) {
    in_flight_.emplace_back();
    return in_flight_.size() - 1;
  }
  const std::uint64_t tag = free_tags_.back();
  free_tags_.pop_back();
  return tag;
}

std::uint64_t World::copy_of(std::uint64_t tag) {
  const std::uint64_t copy = new_tag();
  in_flight_[copy] = in_flight_[tag];
  return copy;
}

void World::put(Wire& wire, bool up, std::uint64_t tag) {
  emu::LinkModel& model = up ? wire.model.up() : wire.model.down();
  const std::size_t ip_bytes = in_flight_[tag].bytes.size() + kIpUdpBytes;
  const bool vanishes = wire.faults.cut || chance(wire.faults.loss);
  if (vanishes || !model.enqueue(now_, ip_bytes, tag)) forget(tag);
}

// A packet has come through the link.
void World::leave(Wire& wire, bool up, emu::LinkModel::Packet packet) {
  // A corrupt packet is lost too, since the receiving host's checksum sees the flipped bit.
  if (packet.lost || packet.corrupt) {
    if (packet.last) forget(packet.tag);
    return;
  }
  if (!packet.last) packet.tag = copy_of(packet.tag);
  Duration by = in_flight_[packet.tag].delay;
  Duration& held_until = wire.held_until[up ? 1 : 0];
  const bool waits = by > Duration{} || held_until >= now_;
  if (waits) {
    by = std::max(by, held_until - now_);
    held_until = now_ + by;
  }
  if (chance(wire.faults.reorder)) {
    by += Duration{std::uniform_int_distribution<std::int64_t>(
        1, std::max<std::int64_t>(1, wire.faults.reorder_by.count()))(rng_)};
  }
  if (waits || by > Duration{}) {
    late_.emplace(now_ + by, packet.tag);
  } else {
    deliver(packet.tag);
  }
}

void World::deliver(std::uint64_t tag) {
  const InFlight& packet = in_flight_[tag];
  const HostId to = packet.to;
  Host& host = hosts_[to];
  host.endpoint->handle_datagram(local(host, now_), {packet.link, packet.from, packet.bytes});
  forget(tag);
  flush(to);
}

Duration World::next_instant() const {
  Duration next = Duration::max();
  for (const Wire& wire : wires_) {
    for (const emu::LinkModel* model : {&wire.model.up(), &wire.model.down()}) {
      if (const auto due = model->next_delivery()) next = std::min(next, *due);
    }
  }
  if (!planned_.empty()) next = std::min(next, planned_.begin()->first);
  if (!late_.empty()) next = std::min(next, late_.begin()->first);
  for (const Host& host : hosts_) {
    if (host.wake) next = std::min(next, *host.wake);
  }
  return next;
}

// Everything that happens at now_, in order.
void World::step() {
  for (Wire& wire : wires_) {
    for (const bool up : {true, false}) {
      emu::LinkModel& model = up ? wire.model.up() : wire.model.down();
      while (const auto packet = model.dequeue(now_)) leave(wire, up, *packet);
    }
  }
  while (!late_.empty() && late_.begin()->first <= now_) {
    const std::uint64_t tag = late_.begin()->second;
    late_.erase(late_.begin());
    deliver(tag);
  }
  while (!planned_.empty() && planned_.begin()->first <= now_) {
    const auto action = std::move(planned_.begin()->second);
    planned_.erase(planned_.begin());
    action();
  }
  for (HostId id = 0; id < hosts_.size(); ++id) {
    Host& host = hosts_[id];
    if (!host.wake || *host.wake > now_) continue;
    host.endpoint->handle_timeout(local(host, now_));
    flush(id);
  }
}

void World::run_until(Duration end) {
  for (;;) {
    const Duration next = next_instant();
    if (next > end) break;
    now_ = std::max(now_, next);
    step();
  }
  now_ = std::max(now_, end);
}

}  // namespace interneuron::sim
