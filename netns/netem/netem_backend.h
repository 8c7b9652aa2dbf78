// Makes the links of a testbed out of the kernel's tc-netem: packets go from NIC to NIC without a
// process in between, and this one sets each end's qdiscs to what the model prescribes, every step
// of the delay process (emu::kDelayStep), where that differs from the step before. netem gives each
// packet the delay that holds when it enters.
//
// Up acts on what the vehicle's NIC sends, down on what the core's gateway NIC sends.
//
// A change takes the kernel 5 to 200 us. When half a step does not suffice for all NICs, the others
// have their turn in the next: each is then set less often, and Effort says so.
//
// Errors: the constructor throws TestbedError (1 without netem, 5 without the right); run() none. A
// change that fails, as it does for a NIC that somebody has deleted, is counted and tried again.
// Thread-compatible; run() takes the thread.
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
    std::size_t link = 0;  // index into the bearers
    emu::Direction direction = emu::Direction::kUp;
  };
  // Of the NICs that wire() makes, in the order of State::links, up before down.
  static std::vector<Egress> egresses(const State& state, const Namespaces& namespaces);

  // Sets all qdiscs, as at the links' time 0. `home` is the network namespace of the caller, who is
  // there again at the end. `bearers` outlive this.
  NetemBackend(const std::vector<Egress>& egresses, int home, Bearers& bearers);
  NetemBackend(const State& state, const Namespaces& namespaces, Bearers& bearers)
      : NetemBackend(egresses(state, namespaces), namespaces.air.get(), bearers) {}

  // Until `stop_fd` becomes readable.
  void run(int stop_fd);

  // What keeping the NICs up to date has taken.
  struct Effort {
    std::uint64_t steps = 0;     // done
    std::uint64_t skipped = 0;   // steps that went by during the one before
    std::uint64_t requests = 0;  // to the kernel, to change something
    std::uint64_t put_off = 0;   // NICs that had to wait for the next step, summed over steps
    std::uint64_t failed = 0;
  };
  const Effort& effort() const { return effort_; }

 private:
  // The NICs of one network namespace.
  struct Site {
    int network_namespace;
    TrafficControl control;
    std::vector<std::size_t> ends;  // indices into ends_, in the order of the control's NICs
  };
  struct End {
    std::size_t site;
    std::size_t nic;  // its number in the site's control
    std::size_t link;
    emu::Direction direction;
  };

  std::size_t site_of(int network_namespace, int home);
  bool rest(TimePoint until);
  void step(TimePoint now);
  std::size_t follow(const End& end, Duration since_epoch);
  bool read_counters(Site& site);
  void look_for_first_packet(TimePoint now);
  void publish_some();

  Bearers& bearers_;
  std::vector<Site> sites_;
  std::vector<End> ends_;
  std::size_t next_end_ = 0;
  std::size_t next_site_ = 0;
  int stop_fd_ = -1;
  Effort effort_;
};

}  // namespace interneuron::netns
