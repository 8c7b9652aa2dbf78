#include "netns/netem/netem_backend.h"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <array>

#include "netns/state/error.h"
#include "netns/state/precedence.h"
#include "netns/wiring/nic_plan.h"
#include "node/io/steady_clock.h"

namespace interneuron::netns {

namespace {

constexpr Duration kStep = Bearers::kAdvanceInterval;
// The part of a step that changes may take. This thread has a real-time priority: on a machine with
// one processor, a larger part would leave too little to everybody else.
constexpr Duration kBudget = kStep / 2;
// How often counters are read: ten times a second is more often than a display shows them.
constexpr Duration kPublishInterval = std::chrono::milliseconds(100);
constexpr std::size_t kStepsPerPublication = kPublishInterval / kStep;

emu::DirectionStats stats_of(const EgressCounters& counters) {
  return emu::DirectionStats{.packets_in = counters.packets_in,
                             .bytes_in = counters.bytes_in,
                             .delivered = counters.packets_sent,
                             .bytes_delivered = counters.bytes_sent,
                             .lost = counters.lost,
                             .queue_drops = counters.queue_drops};
}

}  // namespace

std::vector<NetemBackend::Egress> NetemBackend::egresses(const State& state,
                                                         const Namespaces& namespaces) {
  const std::size_t networks =
      state.links.size() / std::max<std::size_t>(1, namespaces.vehicles.size());
  std::vector<Egress> out;
  for (std::size_t i = 0; i < state.links.size(); ++i) {
    const TestbedLink& link = state.links[i];
    const int vehicle = namespaces.vehicles.at(link.vehicle).get();
    out.push_back({vehicle, link.nic, i, emu::Direction::kUp});
    out.push_back(
        {namespaces.core.get(), gateway_nic(link.vehicle, i % networks), i, emu::Direction::kDown});
  }
  return out;
}

NetemBackend::NetemBackend(const std::vector<Egress>& egresses, int home, Bearers& bearers)
    : bearers_(bearers) {
  for (const Egress& egress : egresses) {
    const std::size_t at = site_of(egress.network_namespace, home);
    Site& site = sites_[at];
    const auto conditions = bearers_.link(egress.link).conditions(egress.direction, Duration{});
    const std::size_t nic = site.control.add(egress.nic, conditions);
    site.ends.push_back(ends_.size());
    ends_.push_back({at, nic, egress.link, egress.direction});
  }
}

std::size_t NetemBackend::site_of(int network_namespace, int home) {
  const auto found = std::find_if(sites_.begin(), sites_.end(), [&](const Site& site) {
    return site.network_namespace == network_namespace;
  });
  if (found != sites_.end()) return static_cast<std::size_t>(found - sites_.begin());
  const NetworkNamespaceScope scope(network_namespace, home);
  sites_.push_back({network_namespace, TrafficControl(), {}});
  return sites_.size() - 1;
}

void NetemBackend::run(int stop_fd) {
  stop_fd_ = stop_fd;
  take_precedence();
  TimePoint due = io::now();
  while (sleep_until(due)) {
    const bool was_waiting = !bearers_.epoch();
    if (was_waiting) look_for_first_packet(io::now());
    // From the epoch on the steps fall on the model's.
    if (was_waiting) due = bearers_.epoch().value_or(due);
    step(io::now());
    due += kStep;
    const TimePoint now = io::now();
    if (due > now) continue;
    // Steps that have passed are skipped, so that the thread sleeps once per step, however late.
    const auto gone_by = (now - due) / kStep + 1;
    effort_.skipped += static_cast<std::uint64_t>(gone_by);
    due += gone_by * kStep;
  }
}

// Sleeps until `until` and serves requests meanwhile, at least once. False when it is time to stop.
bool NetemBackend::sleep_until(TimePoint until) {
  while (true) {
    const Duration wait = std::max(Duration{}, until - io::now());
    const timespec timeout{wait / std::chrono::seconds(1),
                           (wait % std::chrono::seconds(1)).count()};
    std::array<pollfd, 2> fds{{{stop_fd_, POLLIN, 0}, {bearers_.attention_fd(), POLLIN, 0}}};
    const int ready = ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    if (ready > 0 && fds[0].revents != 0) return false;
    if (ready > 0 && fds[1].revents != 0) bearers_.serve(io::now());
    if (io::now() >= until) return true;
  }
}

// Sets NICs in turn until all are done or the step's budget is spent.
void NetemBackend::step(TimePoint now) {
  ++effort_.steps;
  bearers_.advance(now);
  const Duration since_epoch = bearers_.since_epoch(now);
  for (std::size_t done = 0; done < ends_.size(); ++done) {
    const std::size_t requests = set_conditions(ends_[next_end_], since_epoch);
    next_end_ = (next_end_ + 1) % ends_.size();
    effort_.requests += requests;
    if (requests > 0 && io::now() >= now + kBudget) {
      effort_.put_off += ends_.size() - done - 1;
      break;
    }
  }
  if (bearers_.epoch()) publish_some();
}

// Sets one NIC to the conditions of `since_epoch`; returns how many requests that took.
std::size_t NetemBackend::set_conditions(const End& end, Duration since_epoch) {
  const auto conditions = bearers_.link(end.link).conditions(end.direction, since_epoch);
  try {
    return sites_[end.site].control.change(end.nic, conditions);
  } catch (const TestbedError&) {
    ++effort_.failed;
    return 0;
  }
}

// Publishes the counters of one site. True when any packet has come in so far.
bool NetemBackend::read_counters(Site& site) {
  std::vector<EgressCounters> counters;
  try {
    counters = site.control.counters();
  } catch (const TestbedError&) {
    ++effort_.failed;
    return false;
  }
  bool any = false;
  for (std::size_t i = 0; i < site.ends.size(); ++i) {
    const End& end = ends_[site.ends[i]];
    SharedLink& shared = bearers_.shared(end.link);
    SharedDirection& direction = end.direction == emu::Direction::kUp ? shared.up : shared.down;
    direction.store(stats_of(counters[i]));
    any = any || counters[i].packets_in > 0;
  }
  return any;
}

// Begins the links' time when a packet has come. wire() leaves the kernel no reason to send packets
// of its own, so the packet is a program's.
void NetemBackend::look_for_first_packet(TimePoint now) {
  bool seen = false;
  for (Site& site : sites_) seen = read_counters(site) || seen;
  if (seen) bearers_.start(now);
}

// Reads the counters of a part of the sites: each step another part, so that no step reads all.
void NetemBackend::publish_some() {
  SharedStats& stats = bearers_.stats();
  stats.netem_skipped.store(effort_.skipped, std::memory_order_relaxed);
  stats.netem_put_off.store(effort_.put_off, std::memory_order_relaxed);
  stats.netem_failed.store(effort_.failed, std::memory_order_relaxed);
  const std::size_t share = (sites_.size() + kStepsPerPublication - 1) / kStepsPerPublication;
  for (std::size_t i = 0; i < share; ++i) {
    read_counters(sites_[next_site_]);
    next_site_ = (next_site_ + 1) % sites_.size();
  }
}

}  // namespace interneuron::netns
