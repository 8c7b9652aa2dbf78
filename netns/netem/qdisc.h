// The kernel's queueing disciplines (qdiscs) that make a NIC treat the packets it sends as an
// emulated link does, set through netlink. The tree of one NIC, from the root:
//
//   tbf 6:            cuts super-packets into the packets of the wire
//   └ netem 1:        loss, duplicates, corruption, delay, reordering
//     └ netem 2:      loss in bursts; only with Gilbert-Elliott
//       └ htb 3:      the rate, of its one class 3:1
//         └ bfifo 4:  drop-tail queue in bytes, or pfifo 5: in packets
//
// Why this tree:
// - A sender that lets the kernel segment (UDP_SEGMENT, TCP) hands over up to 64 KB at once, which
//   netem would lose, delay and count as one packet. A tbf segments what is longer than its burst;
//   its own rate is far above any link's. (Packets that it has cut count with their Ethernet
//   header: 1 % too much. A super-packet of at most 1500 bytes in all is not cut.)
// - netem's limit counts packets and includes those that are being delayed, so netem cannot be the
//   bottleneck. The bottleneck is behind the delay, because netem takes a child and a bfifo takes
//   none. Delay and waiting time add up to the same in either order, but lost packets do not use
//   the bottleneck.
// - The shaper is an htb, because each change of its rate gives a tbf a full burst: measured 20.8
//   or, with a longer burst, 23.4 instead of 20 Mbit/s where the rate changes every 20 ms, as that
//   of a trace does.
// - netem 1: has a `rate` far above any link's, which makes it keep the order when the delay falls:
//   it then never sends a packet before the one ahead. Without a rate it sorts by due time.
// - Bursts of loss have a netem of their own, because every change puts its chain back into the
//   good state, and the delay may change a hundred times a second.
// - A size table at the root takes the Ethernet header off every packet's length, so that rate,
//   queue and counters are in IP bytes, as in emu::LinkModel.
//
// Conditions that netem cannot make are left out: mtu, and any reorder_by but the whole delay (see
// emu::netem_cannot). A link's queue has a limit in packets and one in bytes, a fifo only one: that
// in packets is used where packets of 1500 bytes reach it first, else that in bytes.
//
// Errors: TestbedError (1), or (5) without the right to set qdiscs. Thread-compatible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lab/emu/conditions.h"
#include "netns/wiring/netlink.h"

namespace interneuron::netns {

// Whether this kernel has netem and htb: tries them on `lo` of the current network namespace and
// removes them again. Throws when `lo` has a qdisc already.
bool kernel_has_netem();

// What one NIC's qdiscs have counted. Duplicates count as packets that came in. Bytes are IP bytes.
struct EgressCounters {
  // The packets sent, lost, dropped by the queue, and still inside.
  std::uint64_t packets_in = 0;
  // An estimate: the kernel does not count the bytes of packets it drops, so these are taken to be
  // as long as the others in the mean.
  std::uint64_t bytes_in = 0;
  std::uint64_t packets_sent = 0;
  std::uint64_t bytes_sent = 0;
  std::uint64_t lost = 0;
  std::uint64_t queue_drops = 0;
};

// Sets and reads the qdiscs of NICs of one network namespace: the one that was current at
// construction, wherever the thread goes afterwards. Owns its netlink socket. Leaves the qdiscs in
// place when destroyed.
class TrafficControl {
 public:
  TrafficControl();
  ~TrafficControl();
  TrafficControl(TrafficControl&&) noexcept;
  TrafficControl& operator=(TrafficControl&&) noexcept;

  // Replaces whatever qdiscs a NIC has. Returns the number by which the other calls name the NIC,
  // counted from 0.
  std::size_t add(const std::string& nic, const emu::Conditions& conditions);
  // Changes the conditions of a NIC from now on; packets inside keep the time at which they are
  // due. Tells the kernel only what differs (delay in whole microseconds) and returns how many
  // requests that took, kMostRequests at most. Where a chain of loss bursts comes or goes the whole
  // tree is made anew, and the packets inside are lost.
  static constexpr std::size_t kMostRequests = 5;
  std::size_t change(std::size_t nic, const emu::Conditions& conditions);
  void remove(std::size_t nic);

  // The counters of all NICs, by their numbers, from one reading of the kernel's.
  std::vector<EgressCounters> counters();

 private:
  struct Nic;

  netlink::Socket socket_;
  std::vector<Nic> nics_;
};

}  // namespace interneuron::netns
