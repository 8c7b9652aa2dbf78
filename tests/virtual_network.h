// Virtual time for tests that join pure machines: packets in flight, and actions planned for later.
// The test owns the machines; it sends what they hand over, asks for the next instant, and moves
// there. For emulated links with queues and loss there is sim::World (src/lab/sim/world.h).
#pragma once

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "interneuron/time.h"

namespace interneuron {

// Packets are delivered in the order of their arrival, those of one instant in the order in which
// they were sent; what is planned for that instant comes after them.
template <class Packet>
class VirtualNetwork {
 public:
  TimePoint now() const { return now_; }

  void send(TimePoint arrives, Packet packet) { in_flight_.emplace(arrives, std::move(packet)); }
  void plan(TimePoint at, std::function<void()> action) { planned_.emplace(at, std::move(action)); }

  // The next instant at which a packet arrives or an action is planned; nothing: never.
  std::optional<TimePoint> next() const {
    std::optional<TimePoint> out;
    if (!in_flight_.empty()) out = in_flight_.begin()->first;
    if (!planned_.empty() && (!out || planned_.begin()->first < *out)) {
      out = planned_.begin()->first;
    }
    return out;
  }

  // Moves on to `t`, never back.
  void move_to(TimePoint t) { now_ = std::max(now_, t); }

  // Hands every packet that has arrived by now to `deliver`, then does what was planned until now.
  template <class Deliver>
  void run(const Deliver& deliver) {
    while (!in_flight_.empty() && in_flight_.begin()->first <= now_) {
      const Packet packet = std::move(in_flight_.extract(in_flight_.begin()).mapped());
      deliver(packet);
    }
    while (!planned_.empty() && planned_.begin()->first <= now_) {
      planned_.extract(planned_.begin()).mapped()();
    }
  }

 private:
  std::multimap<TimePoint, Packet> in_flight_;
  std::multimap<TimePoint, std::function<void()>> planned_;
  TimePoint now_{std::chrono::seconds(1)};
};

}  // namespace interneuron
