// The hosts of one transport in a world: vehicles that send messages through a shared bottleneck,
// and a roadside unit that gets them. Every vehicle has a link of its own to the roadside unit
// (those of MPTCP two), which is fast and has no queue worth the name: the bottleneck is the cell
// that all of them go up through.
//
// A fleet adds its hosts to the world when it is made and tells the meter what arrives; both must
// outlive it. Pure; thread-compatible; no errors.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lab/foreign/transports.h"
#include "lab/load/meter.h"
#include "lab/load/scenario.h"
#include "lab/sim/world.h"

namespace interneuron::load {

class Fleet {
 public:
  virtual ~Fleet() = default;
  // The vehicle hands over the message that the meter knows by this number.
  virtual void send(std::size_t vehicle, std::uint32_t number) = 0;
  // Tells the meter of all that has arrived by now.
  virtual void collect() {}
};

// How a host of a scenario reaches another: adds a link from `vehicle` to `road` that is fast both
// ways, and up through the cell.
void join(const Scenario& scenario, sim::World& world, sim::HostId vehicle, sim::HostId road,
          LinkId link, sim::CellId cell);

// Interneuron's endpoints as they are in production, in a world: a roadside unit, and vehicles that
// send it the messages of a scenario by the policy that the peer stands for. Keys and sessions are
// by the number of the host.
class OurHosts {
 public:
  // `vehicle` is what each vehicle is beside its session and keys; with its policies, the
  // roadside unit has them too. `links` adds the links between the two. A vehicle that joins later
  // (joins()) does so if these hosts are where they were made.
  OurHosts(const Scenario& scenario, sim::World& world, EndpointOptions vehicle,
           const std::function<void(sim::HostId vehicle, sim::HostId road)>& links);

  // The vehicle hands over a message that begins with `number` (sim::number_of()). The caller
  // flushes the vehicle.
  SendResult send(std::size_t vehicle, std::uint64_t number);
  Variants variants(std::uint64_t number) const;

  sim::HostId road = 0;
  std::vector<sim::HostId> vehicles;
  // The roadside unit as each vehicle knows it, from when it has joined.
  std::vector<PeerId> peers;

 private:
  const Scenario& s_;
  sim::World& world_;
};

// The policy that plans the messages of a peer of ours.
std::string policy_of(Peer peer);

std::unique_ptr<Fleet> ours(const Scenario& scenario, sim::World& world, sim::CellId cell,
                            Meter& meter);
std::unique_ptr<Fleet> make_fleet(const Scenario& scenario, sim::World& world, sim::CellId cell,
                                  Meter& meter);

// The cross flows of the scenario up through the cell, to hosts of their own.
class CrossTraffic {
 public:
  CrossTraffic(const Scenario& scenario, sim::World& world, sim::CellId cell);
  // All flows begin now.
  void start();
  // Payload of all flows that applications could read by now.
  std::uint64_t readable_bytes() const;

 private:
  sim::World& world_;
  // The world owns them.
  foreign::MessageSink* sink_ = nullptr;
  std::vector<foreign::MessageSource*> sources_;
  std::vector<sim::HostId> hosts_;
};

}  // namespace interneuron::load
