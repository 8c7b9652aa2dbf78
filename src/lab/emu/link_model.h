// One direction of an emulated link: a bottleneck (rate, drop-tail queue) followed by a delay line
// fed by a DelayProcess, in order (a radio bearer is FIFO), with loss and the other faults of
// DirectionParams. Used by sim::World in virtual time and by the user-space emulator on real
// packets, so that both see the same link.
//
//   enqueue -> MTU, NAT -> [ drop-tail queue -> bottleneck ] -> outage, loss -> [ delay line ] ->
//   dequeue
//
// Delay, loss and outage are those at the instant at which the packet has left the bottleneck.
// Each random feature draws from a stream of its own. A packet costs about 100 ns and, once the
// link has been as full, no allocation.
//
// Pure; times are "since the start of the link". Thread-compatible, together with all that share
// its Channel.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "core/base/ring.h"
#include "interneuron/units.h"
#include "lab/emu/channel.h"
#include "lab/emu/conditions.h"
#include "lab/emu/random.h"

namespace interneuron::emu {

// packets_in + duplicated = delivered + lost + queue_drops + outage_lost + too_big + nat_drops
//                           + still inside (a duplicated packet twice)
struct DirectionStats {
  std::uint64_t packets_in = 0;
  std::uint64_t bytes_in = 0;
  std::uint64_t delivered = 0;  // with duplicates and corrupt ones
  std::uint64_t bytes_delivered = 0;
  std::uint64_t lost = 0;         // by the radio
  std::uint64_t queue_drops = 0;  // at the tail of the queue
  std::uint64_t duplicated = 0;   // extra copies made
  std::uint64_t corrupted = 0;    // of `delivered`
  std::uint64_t reordered = 0;    // moved out of order, whether or not another was there to pass
  std::uint64_t outage_lost = 0;  // left the bottleneck while there was no radio
  std::uint64_t too_big = 0;      // larger than the path MTU
  std::uint64_t nat_drops = 0;    // too small, or without a mapping
};

class LinkModel {
 public:
  LinkModel(const DirectionParams& params, std::shared_ptr<Channel> channel, Direction direction,
            std::uint64_t seed);

  struct Packet {
    std::uint64_t tag = 0;  // the caller's handle of the packet
    std::size_t ip_bytes = 0;
    Duration due{};        // when it leaves the link
    bool corrupt = false;  // flip one bit of it
    bool last = true;      // no further copy of this tag comes: the caller frees its bytes
    // An outage or a change, told after it had entered, took it from the queue: only to be freed.
    bool lost = false;
  };

  // A packet enters at `now`, which never goes back. False when it was lost or dropped (and
  // counted); the caller may then forget it. True: the tag comes out of dequeue() until `last`.
  // Dropped at the tail of the queue: while packets wait for the bottleneck (the one on its way
  // through it included, whole), when this one would make them more than queue_bytes or
  // queue_packets; an idle bottleneck takes any packet. Dropped there, too: what would have to wait
  // longer than kLongestWait. Lost packets have used the bottleneck.
  bool enqueue(Duration now, std::size_t ip_bytes, std::uint64_t tag);
  // When the next packet leaves, if any is inside.
  std::optional<Duration> next_delivery() const;
  // The next packet that is due at `now`, if any: in the order of entry but for those reordered.
  std::optional<Packet> dequeue(Duration now);

  // From `now` on these parameters, and whatever has changed in the channel. What still waits for
  // the bottleneck gets the new rate and delay; it keeps its draws (loss, corruption, …), so a
  // packet lost or duplicated stays so.
  void change(Duration now, const DirectionParams& params);
  // An outage in [from, to) was added to the channel.
  void outage_added(Duration from, Duration to);

  Conditions conditions(Duration now) const;

  const DirectionParams& params() const { return params_; }
  const DirectionStats& stats() const { return stats_; }
  std::size_t waiting_bytes(Duration now);  // for the bottleneck

  // What a delay process remembers: a packet's delay is read when it leaves the queue.
  static constexpr Duration kLongestWait = DelayProcess::kMemory;

 private:
  struct Waiting {  // for the bottleneck, lost packets too
    Duration departure{};
    std::size_t bytes = 0;
    bool dropped = false;  // a change made it too late
  };
  struct Entry {
    Duration due{};
    Duration departure{};
    Duration shift{};  // of a packet out of order, against its turn
    std::uint64_t tag = 0;
    std::uint64_t serial = 0;  // of all that have used the bottleneck
    std::size_t bytes = 0;
    std::uint8_t copies = 1;
    bool corrupt = false;
    bool lost = false;
  };
  struct Later;  // orders the heap: earliest due first, then by serial

  bool refused(Duration now, std::size_t ip_bytes);
  bool admitted(std::size_t ip_bytes) const;
  bool radio_loses(const Channel::Sample& sample);
  bool burst_loses();
  Duration shift_of(std::size_t ip_bytes);
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
  std::mt19937_64 loss_rng_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  RandomStream burst_stream_;
  RandomStream duplicate_stream_;
  RandomStream corrupt_stream_;
  RandomStream reorder_stream_;
  RandomStream nat_stream_;
  bool burst_ = false;  // Gilbert-Elliott's bad state
  Ring<Waiting> waiting_;
  std::size_t waiting_bytes_ = 0;
  std::uint64_t next_serial_ = 0;
  Duration last_due_{};        // keeps the order
  Duration delivered_due_{};   // of the last in order that left
  Ring<Entry> line_;           // in order of entry and of due
  std::vector<Entry> strays_;  // a heap: those out of order
  DirectionStats stats_;
};

}  // namespace interneuron::emu
