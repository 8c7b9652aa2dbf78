// What a NIC does to the packets it sends: queueing disciplines of the kernel, set through netlink.
//
//   tbf 6:            cuts super-packets into the packets of the wire
//   └ netem 1:        loss, duplicates, corruption, delay, reordering
//     └ netem 2:      loss in bursts; only with Gilbert-Elliott
//       └ htb 3:      the rate, of its one class 3:1
//         └ bfifo 4:  drop-tail queue in bytes, or pfifo 5: in packets
//
// Why so:
// - A sender that lets the kernel segment (UDP_SEGMENT, TCP) hands over up to 64 KB at once, which
//   netem would lose, delay and count as one packet; a tbf segments what is longer than its burst.
//   Its own rate is beyond any link's. (What it has cut counts with its
//   Ethernet header: 1 %. A super-packet of at most 1500 bytes in all stays one.)
// - netem's limit counts packets, those on the way included, so the bottleneck is not netem's; and
//   it is behind the delay, because netem takes a child and a bfifo takes none. Delay and queue add
//   up to the same either way round; but lost packets do not use the bottleneck.
// - htb, not tbf: each change of its rate gives a tbf a full burst (20.8 or, with a longer burst,
//   23.4 instead of 20 Mbit/s where the rate changes every 20 ms, as that of a trace does).
// - netem 1: has a `rate` beyond any link's, because that makes it keep the order when the delay
//   falls: it then never sends before the packet ahead; without, it sorts by due time.
// - The bursts have a netem of their own, because every change puts that chain back into its good
//   state, and the delay may change a hundred times a second.
// - A size table of the root takes the Ethernet header off every packet's length, so that rate,
// queue and
//   counters are of IP bytes, as in emu::LinkModel.
//
// What Conditions have and netem has not is left out: mtu, and of reorder_by all but the whole
// delay (see emu::netem_cannot). Of the queue's limits that in packets counts where 1500-byte
// packets reach it first, else that in bytes.
//
// Errors: TestbedError; (5) without the right to do it. Thread-compatible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "lab/emu/conditions.h"
#include "netns/wiring/netlink.h"

namespace interneuron::netns {

// Whether this kernel has netem and htb, by trying on `lo` of the current network namespace, which
// is left as it was. Throws when `lo` has a qdisc already.
bool kernel_has_netem();

// What one NIC's qdiscs have counted. Duplicates count as packets that came in.
struct EgressCounters {
  std::uint64_t packets_in = 0;  // = sent + lost + queue_drops + what is inside
  std::uint64_t bytes_in = 0;    // estimated: the kernel does not count the bytes it drops
  std::uint64_t packets_sent = 0;
  std::uint64_t bytes_sent = 0;
  std::uint64_t lost = 0;
  std::uint64_t queue_drops = 0;
};

// The qdiscs of the NICs of one network namespace: the one that was current at construction,
// wherever the thread goes afterwards. Leaves the qdiscs in place when destroyed.
class TrafficControl {
 public:
  TrafficControl();
  ~TrafficControl();
  TrafficControl(TrafficControl&&) noexcept;
  TrafficControl& operator=(TrafficControl&&) noexcept;

  // Puts qdiscs on a NIC's egress, instead of what is there. Returns the NIC's number here, from 0.
  std::size_t add(const std::string& nic, const emu::Conditions& conditions);
  // From now on; packets inside keep their due time. Tells the kernel only what differs (delay in
  // whole microseconds) and returns how many requests that took. A chain of bursts that comes
  // or goes makes everything anew, and what is inside is lost.
  static constexpr std::size_t kMostRequests = 5;
  std::size_t change(std::size_t nic, const emu::Conditions& conditions);
  void remove(std::size_t nic);

  // Of all NICs, as numbered. One look at the kernel's counters.
  std::vector<EgressCounters> counters();

 private:
  struct Nic;

  netlink::Socket socket_;
  std::vector<Nic> nics_;
};

}  // namespace interneuron::netns
