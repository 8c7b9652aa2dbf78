// One direction of an emulated link: a bottleneck (rate, drop-tail queue in bytes) followed by a
// delay line fed by a DelayProcess, in order (a radio bearer is FIFO), with state-dependent loss.
// Used by sim::World in virtual time and by the user-space emulator on real packets, so that both
// see the same link.
//
//   enqueue -> [ drop-tail queue -> bottleneck ] -> loss -> [ delay line: rtt / 2 ] -> dequeue
//
// Delay and loss are those of the process at the instant at which the packet has left the
// bottleneck.
//
// Pure; times are "since the start of the link's process". Thread-compatible.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>

#include "emu/delay_process.h"
#include "interneuron/units.h"

namespace interneuron::emu {

struct DirectionParams {
  DataRate rate{};              // of the bottleneck; IP bytes count. <= 0: nothing passes
  std::size_t queue_bytes = 0;  // drop-tail limit of what waits for the bottleneck, see enqueue()
};

struct DirectionStats {
  std::uint64_t packets_in = 0;  // = delivered + lost + queue_drops + still inside
  std::uint64_t bytes_in = 0;
  std::uint64_t delivered = 0;
  std::uint64_t bytes_delivered = 0;
  std::uint64_t lost = 0;  // by the radio
  std::uint64_t queue_drops = 0;
};

// A full duplex link shares one process between its two directions.
class LinkModel {
 public:
  LinkModel(DirectionParams params, std::shared_ptr<DelayProcess> process, std::uint64_t loss_seed);

  struct Packet {
    std::uint64_t tag = 0;  // the caller's handle of the packet
    std::size_t ip_bytes = 0;
    Duration due{};  // when it leaves the link
  };

  // A packet enters at `now`, which never goes back. False when it was lost or dropped (and
  // counted); the caller may then forget it. Dropped: while the bottleneck is busy, what it still
  // has to send, this packet included, would be more than queue_bytes (an idle bottleneck takes any
  // packet). Lost packets have used the bottleneck.
  bool enqueue(Duration now, std::size_t ip_bytes, std::uint64_t tag);
  // When the next packet leaves, if any is inside.
  std::optional<Duration> next_delivery() const;
  // The next packet that is due at `now`, if any; in the order of entry.
  std::optional<Packet> dequeue(Duration now);

  const DirectionStats& stats() const { return stats_; }

 private:
  double backlog_bytes(Duration now) const;
  void transmit(Duration now, std::size_t ip_bytes);

  DirectionParams params_;
  std::shared_ptr<DelayProcess> process_;
  std::mt19937_64 rng_;
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
  Duration busy_until_{};  // of the bottleneck
  std::int64_t busy_remainder_ =
      0;                 // the part of a nanosecond beyond it, in 1/rate ns: keeps the rate exact
  Duration last_due_{};  // keeps the order
  std::deque<Packet> inside_;
  DirectionStats stats_;
};

}  // namespace interneuron::emu
