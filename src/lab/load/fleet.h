// The hosts of one transport in a world: vehicles that send messages through a shared bottleneck,
// and a roadside unit that gets them. Every vehicle has a link of its own to the roadside unit
// (those of MPTCP two), which is fast and has no queue worth the name: the bottleneck is the cell
// that all of them go up through.
//
// A fleet adds its hosts to the world when it is made and tells the meter what arrives; both must
// outlive it. Pure; thread-compatible; no errors.
#pragma once

#include <memory>
#include <vector>

#include "lab/foreign/message.h"
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

std::unique_ptr<Fleet> make_fleet(const Scenario& scenario, sim::World& world, sim::CellId cell,
                                  Meter& meter);

// CUBIC flows with unlimited demand up through the cell, to hosts of their own.
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
