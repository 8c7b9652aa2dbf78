// Drives the links of a testbed by the kernel's tc-netem. Packets go from NIC to NIC without a
// process in between; this class sets the queueing disciplines (qdiscs) of each NIC to what the
// model prescribes, at every step of the delay process (emu::kDelayStep), as far as that differs
// from the step before. netem gives each packet the delay that holds when the packet enters.
//
// Direction up is set at the vehicle's NIC, which sends it; down at the core's gateway NIC.
//
// A change takes the kernel 5 to 200 us. When half a step does not suffice for all NICs, the rest
// is set in the next step: each NIC is then set less often, and Effort counts that.
//
// Errors: the constructor throws TestbedError (1 without netem, 5 without the right); run() throws
// none. A change that fails, for example at a NIC that somebody has deleted, is counted and tried
// again. Thread-compatible; run() takes the thread. Owns the sockets to the kernel; the qdiscs stay
// until the namespaces go.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "netns/netem/qdisc.h"
#include "netns/state/bearers.h"
#include "netns/wiring/namespaces.h"

namespace interneuron::netns {

class NetemBackend {
 public:
  // One direction of one link: a NIC whose outgoing packets it impairs.
  struct Egress {
    int network_namespace = -1;
    std::string nic;
    // Index into the bearers.
    std::size_t link = 0;
    emu::Direction direction = emu::Direction::kUp;
  };
  // The NICs that wire() has made: in the order of State::links, of each link up before down.
  static std::vector<Egress> egresses(const State& state, const Namespaces& namespaces);

  // Sets all qdiscs to what the models prescribe at time 0. `home` is the network namespace of the
  // caller, who is there again at the end. `bearers` must outlive this.
  NetemBackend(const std::vector<Egress>& egresses, int home, Bearers& bearers);
  NetemBackend(const State& state, const Namespaces& namespaces, Bearers& bearers)
      : NetemBackend(egresses(state, namespaces), namespaces.air.get(), bearers) {}

  // Sets the qdiscs at every step until `stop_fd` becomes readable.
  void run(int stop_fd);

  // How much work keeping the NICs up to date has been, and how often there was too much of it.
  struct Effort {
    // Steps done, and steps that passed while the one before was still at work.
    std::uint64_t steps = 0;
    std::uint64_t skipped = 0;
    // Requests to the kernel to change something.
    std::uint64_t requests = 0;
    // NICs that had to wait for the next step, summed over all steps.
    std::uint64_t put_off = 0;
    // Requests that the kernel refused.
    std::uint64_t failed = 0;
  };
  const Effort& effort() const { return effort_; }

 private:
  // The NICs of one network namespace.
  struct Site {
    int network_namespace;
    TrafficControl control;
    // Indices into ends_, in the order of the control's NICs.
    std::vector<std::size_t> ends;
  };
  // One direction of one link: NIC number `nic` of the control of site `site`.
  struct End {
    std::size_t site;
    std::size_t nic;
    std::size_t link;
    emu::Direction direction;
  };

  std::size_t site_of(int network_namespace, int home);
  bool sleep_until(TimePoint until);
  void step(TimePoint now);
  std::size_t set_conditions(const End& end, Duration since_epoch);
  bool read_counters(Site& site);
  void look_for_first_packet(TimePoint now);
  void publish_some();

  Bearers& bearers_;
  std::vector<Site> sites_;
  std::vector<End> ends_;
  // Where the next step goes on: with setting, and with reading counters.
  std::size_t next_end_ = 0;
  std::size_t next_site_ = 0;
  int stop_fd_ = -1;
  Effort effort_;
};

}  // namespace interneuron::netns
