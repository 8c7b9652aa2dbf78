// One direction of an emulated link: a bottleneck with a drop-tail queue, then a delay line that
// keeps the order (a radio bearer is first in, first out), with loss and the other faults of
// DirectionParams. sim::World uses it in virtual time and the user-space emulator on real packets,
// so that both have the same link. It keeps handles of packets (tags), never their bytes.
//
//   enqueue -> MTU, NAT, policer -> [ drop-tail queue -> bottleneck -> shaper ] -> outage, loss ->
//   [ delay line ] -> dequeue
//
// Delay, loss and outage are those at the instant at which the packet leaves the bottleneck. Each
// random feature draws from a stream of its own, so that turning one on does not change another. A
// packet costs about 100 ns, and no allocation unless more packets are inside than ever before.
//
// Bounds: what waits for the bottleneck by queue_bytes, queue_packets and kLongestWait; what is in
// the delay line by the rate and the delay. Pure; no errors; times are since the start of the link.
// Thread-compatible, together with all that share its Channel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "core/base/ring.h"
#include "interneuron/units.h"
#include "lab/emu/conditions.h"
#include "lab/emu/delay_process.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

class Channel;

// Counters of one direction since its start; bytes are IP bytes. Always
//   packets_in + duplicated = delivered + lost + queue_drops + outage_lost + too_big + nat_drops
//                             + policed + packets inside (a duplicated packet twice)
struct DirectionStats {
  std::uint64_t packets_in = 0;
  std::uint64_t bytes_in = 0;
  // With duplicates and corrupted packets.
  std::uint64_t delivered = 0;
  std::uint64_t bytes_delivered = 0;
  // Lost by the radio.
  std::uint64_t lost = 0;
  // Dropped at the tail of the queue.
  std::uint64_t queue_drops = 0;
  // Extra copies made.
  std::uint64_t duplicated = 0;
  // How many of those delivered had a bit flipped.
  std::uint64_t corrupted = 0;
  // Moved out of order, also when there was no packet to overtake.
  std::uint64_t reordered = 0;
  // Left the bottleneck in an outage.
  std::uint64_t outage_lost = 0;
  // Larger than the path MTU.
  std::uint64_t too_big = 0;
  // Dropped by the NAT: too small, or without a mapping.
  std::uint64_t nat_drops = 0;
  // Dropped by the policer.
  std::uint64_t policed = 0;
};

class LinkModel {
 public:
  LinkModel(const DirectionParams& params, std::shared_ptr<Channel> channel, Direction direction,
            std::uint64_t seed);

  struct Packet {
    // The caller's handle of the packet.
    std::uint64_t tag = 0;
    std::size_t ip_bytes = 0;
    // When it leaves the link.
    Duration due{};
    // The caller is to flip one bit of it.
    bool corrupt = false;
    // No further copy of this tag comes, so the caller may free its bytes.
    bool last = true;
    // The packet was lost after it had entered, by an outage or a change made later: the caller
    // only frees it.
    bool lost = false;
  };

  // A packet enters at `now`, which never goes back. Returns false when it was lost or dropped (and
  // counted), and the caller may forget it; else the tag comes out of dequeue() until `last`.
  //
  // A packet is dropped at the tail of the queue when it would make the packets that wait for the
  // bottleneck (with the whole of the one that is leaving it) more than queue_bytes or
  // queue_packets, or would have to wait longer than kLongestWait. An idle bottleneck takes any
  // packet. Packets that the radio loses use the bottleneck like others.
  bool enqueue(Duration now, std::size_t ip_bytes, std::uint64_t tag);
  // When the next packet leaves, if any is inside.
  std::optional<Duration> next_delivery() const;
  // The next packet that is due at `now`, if any: in the order of entry but for those reordered.
  std::optional<Packet> dequeue(Duration now);

  // Uses these parameters from `now` on, and what has changed in the channel. Packets that still
  // wait for the bottleneck get the new rate and delay but keep what was drawn for them (loss,
  // corruption, duplication). A bucket that has changed is full, but that of a shaper for which
  // packets wait is empty.
  void change(Duration now, const DirectionParams& params);
  // To be called when an outage [from, to) was added to the channel.
  void outage_added(Duration from, Duration to);

  Conditions conditions(Duration now) const;

  const DirectionParams& params() const { return params_; }
  const DirectionStats& stats() const { return stats_; }
  // The bytes that wait for the bottleneck.
  std::size_t waiting_bytes(Duration now) const;

  // A packet's delay is read when it leaves the queue, from a process that remembers this long.
  static constexpr Duration kLongestWait = DelayProcess::kMemory;

 private:
  // A packet that waits for the bottleneck, also one that the radio will lose.
  struct Waiting {
    Duration departure{};
    std::size_t bytes = 0;
    // A change has made it wait too long.
    bool dropped = false;
  };
  // A packet inside the link.
  struct Entry {
    Duration due{};
    Duration departure{};
    // By how much a reordered packet is due later than its turn (negative: earlier).
    Duration shift{};
    // How long the radio took to send it again.
    Duration held{};
    std::uint64_t tag = 0;
    // Counts all packets that have used the bottleneck.
    std::uint64_t serial = 0;
    std::size_t bytes = 0;
    std::uint8_t copies = 1;
    bool corrupt = false;
    bool lost = false;
  };
  // Orders the heap: earliest due first, then by serial.
  struct Later;

  bool refused(Duration now, std::size_t ip_bytes);
  bool admitted(std::size_t ip_bytes) const;
  Duration departure(Duration at, std::size_t ip_bytes);
  void send(Duration departure, std::size_t ip_bytes);
  bool radio_loses(double loss);
  bool burst_loses();
  Duration shift_of(std::size_t ip_bytes);
  Duration sent_again_for();
  void place(Entry& entry, Duration one_way);
  void place_again(Entry& entry, Duration now);
  template <class Visit>
  void each_inside(Visit&& visit);
  void settle(Duration now);
  void serve_again(Duration now);
  static void give_up(Entry& entry, std::uint64_t& counter);
  Packet hand_out(Entry& entry);

  DirectionParams params_;
  std::shared_ptr<Channel> channel_;
  Direction direction_;
  Bottleneck bottleneck_;
  TokenBucket police_;
  TokenBucket shape_;
  std::mt19937_64 loss_rng_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  RandomStream burst_stream_;
  RandomStream duplicate_stream_;
  RandomStream corrupt_stream_;
  RandomStream reorder_stream_;
  RandomStream nat_stream_;
  RandomStream harq_stream_;
  // The Gilbert-Elliott chain is in its bad state.
  bool burst_ = false;
  // Packets of it so far.
  std::uint32_t burst_packets_ = 0;
  Ring<Waiting> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::uint64_t next_serial_ = 0;
  // No packet in order is due before this.
  Duration last_due_{};
  // When the last packet in order that left was due.
  Duration delivered_due_{};
  // Packets in order, by entry and by due time.
  Ring<Entry> line_;
  // Packets out of order, as a heap.
  std::vector<Entry> strays_;
  DirectionStats stats_;
};

}  // namespace interneuron::emu
