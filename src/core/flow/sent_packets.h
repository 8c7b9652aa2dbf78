// The packets that one path has sent: what became of each, and what that says of loss and rate.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/flow/packet_log.h"
#include "core/link/delivery_rate.h"
#include "core/link/path_mtu.h"
#include "core/link/rate_estimator.h"
#include "core/wire/feedback.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// The sender's record of one path: numbers its packets, remembers each for some seconds, and
// settles it as arrived or lost. Sender owns one per path.
//
// A packet is lost when one sent after it has arrived and it is overdue: a round trip and the
// reordering window have passed since it left (RACK, RFC 8985). While no packet has been overtaken
// on its way, one is also lost when one sent three later has arrived (RFC 9002 §6.1.1), and else
// when no report comes for the path's probe timeout. It may still arrive after that and is then
// told again; what is late in that way widens the window. Reports are the peer's word: those of
// numbers that were never sent are ignored, and others harm only what is sent to itself.
//
// Memory is bounded by 20,000 records of PacketLog's. Pure; never throws; no two threads may call
// even const functions at once, since sent_at() keeps what it has looked up.
class SentPackets {
 public:
  // A packet is lost when one sent this many later has arrived (RFC 9002 §6.1.1).
  static constexpr std::uint64_t kReorderPackets = 3;
  using Piece = PacketLog::Piece;
  // What became known of a fragment.
  struct Settled {
    Piece piece;
    bool arrived = false;
    // False when it was taken for lost before and has arrived after all.
    bool was_open = false;
  };
  // Packets of the same outcome in a row, in the order of their numbers.
  struct Run {
    bool arrived = false;
    std::uint32_t packets = 0;
  };
  // What a report tells. The spans are valid until the next call.
  struct Verdicts {
    std::span<const Settled> pieces;
    // Outcomes that are certain, late arrivals included. What is lost by silence is among them once
    // a report has come that would tell of it; packets whose reports were lost are not.
    std::span<const Run> runs;
    // See PassedPackets.
    std::span<const link::Passage> passed;
    // When the newest of the acknowledged packets left.
    std::optional<TimePoint> newest_sent;
    // One of the acknowledged packets was data-sized.
    bool data = false;
    // The report's train; nothing when its packets are forgotten already.
    std::optional<link::Train> train;
    std::optional<link::DeliveryRate::Sample> delivery;
    // What became of large and of small packets since the report before.
    link::PathMtu::Told sizes;
    // Packets that left with ECT and have arrived.
    std::uint32_t ect_arrived = 0;
  };

  explicit SentPackets(std::uint64_t first_number = 1)
      : log_(first_number),
        first_open_(first_number),
        first_uncertain_(first_number),
        first_missed_(first_number) {}

  // Whether data-sized packets leave with ECT from now on (link::PathEcn).
  void set_ect(bool ect) { ect_ = ect; }
  // A small packet leaves; returns its number.
  std::uint64_t add_small(TimePoint now);
  // A data-sized packet leaves, which counts for trains, rates and proof of delivery; returns its
  // number. `ip_bytes` is its size with IP headers; `more_waits` when others wait behind it.
  std::uint64_t add(TimePoint now, std::size_t ip_bytes, bool more_waits,
                    const std::optional<Piece>& piece);
  // A probe of the path's MTU leaves, which is expected to be lost: that says nothing of the path.
  std::uint64_t add_mtu_probe(TimePoint now, std::size_t ip_bytes);

  // A fragment is lost after `timeout` in flight, but not while others are acknowledged at most
  // `between` apart: then what is late waits in our own queue.
  struct Silence {
    Duration timeout{};
    Duration between{};
  };
  // The peer's report of this path came in. `min_rtt` is the path's smallest round trip, below
  // which delivery rate samples say nothing.
  Verdicts report(TimePoint now, const wire::LinkReport& report, Duration min_rtt,
                  const Silence& silence);
  // Fragments that are lost at `now` by silence or because they are overdue; valid until the next
  // call.
  std::span<const Settled> settle_silent(TimePoint now, const Silence& silence);
  // When the oldest fragment in flight will be lost so.
  std::optional<TimePoint> silent_at(const Silence& silence) const;

  // Calls `what` with each fragment in flight, oldest first.
  template <class What>
  void for_each_in_flight(const What& what) const {
    for (std::uint64_t n = first_open_; log_.keeps(n); ++n) {
      const Packet& packet = log_.at(n);
      if (packet.is_open_piece()) what(piece_of(packet));
    }
  }
  // When the newest copy of a fragment in flight left. Where many are asked for and nothing happens
  // in between, as when a path is pulled, each takes logarithmic time.
  std::optional<TimePoint> sent_at(const Piece& piece) const;
  // The number of the first copy of this fragment that left at `since` or later. Looks at all
  // packets since then.
  std::optional<std::uint64_t> first_copy(const Piece& piece, TimePoint since) const;
  // Whether the records of all packets that left at `since` or later are kept.
  bool keeps_all_since(TimePoint since) const { return newest_dropped_ < since; }
  // When the oldest of the fragments left that were sent after all that is acknowledged and are in
  // flight, or are of this message, which the peer may not have told of; nothing when none was.
  std::optional<TimePoint> awaited_since(MessageId message) const;
  // When the newest packet left, of whatever kind.
  TimePoint newest_left() const {
    return log_.size() == 0 ? TimePoint::min() : log_.at(log_.next() - 1).at;
  }
  // Bytes of the fragments in flight, IP headers included.
  std::size_t bytes_in_flight() const { return open_bytes_; }
  // Packets found lost since the path exists.
  std::uint64_t lost() const { return lost_; }
  // Forgets what is in flight; the numbers go on.
  void reset();
  // The number of the next packet.
  std::uint64_t next_number() const { return log_.next(); }

 private:
  using Packet = PacketLog::Packet;
  using Fate = PacketLog::Fate;
  Piece piece_of(const Packet& packet) const { return log_.data_of(packet).piece(); }
  // When an open packet is overdue by the reordering window, or silent; the sooner of both counts.
  TimePoint overdue_at(const Packet& packet) const;
  TimePoint silent_at(const Packet& oldest, const Silence& silence) const;
  TimePoint lost_at(std::uint64_t number, const Silence& silence) const;
  void note_reordering(TimePoint now, const Packet& packet);
  void lose_overdue(TimePoint now, const wire::LinkReport& report);
  void lose_untold(TimePoint now, std::uint64_t largest, Duration timeout);
  Packet& record(TimePoint now);
  void trim(TimePoint now);
  void index_copies() const;
  // A data-sized packet is no longer in flight.
  void close(const Packet& packet);
  void lose(Packet& packet);
  bool is_large(const Packet& packet) const;
  link::DeliveryStamp stamp_of(const Packet& packet) const;
  void arrive(TimePoint now, std::uint64_t number, Verdicts& verdicts);
  bool is_certain(TimePoint now, std::uint64_t n, std::uint64_t largest, Duration timeout) const;
  std::uint64_t first_of_interest(std::uint64_t largest);
  void tell_certain(TimePoint now, std::uint64_t largest, Duration timeout);

  PacketLog log_;
  // When the newest packet left of which there is no record any more.
  TimePoint newest_dropped_ = TimePoint::min();
  // All packets before this number are settled.
  std::uint64_t first_open_ = 1;
  // The outcome of all packets before this number has been told in Verdicts::runs.
  std::uint64_t first_uncertain_ = 1;
  // All packets before this number have arrived, or reports tell no more of them: one that is
  // certainly lost as losses are counted may still arrive, and its fragment then counts.
  std::uint64_t first_missed_ = 1;
  // Data-sized packets in flight, bytes of all that were ever sent, and bytes of fragments in
  // flight.
  std::uint64_t open_data_ = 0;
  std::uint32_t train_bytes_ = 0;
  std::size_t open_bytes_ = 0;
  SentTrain train_;
  link::DeliveryRate delivery_;
  // The largest number that has arrived; of the packet that left last of all that have arrived,
  // when it left and its round trip; and the path's smallest one.
  std::uint64_t largest_ = 0;
  TimePoint newest_at_ = TimePoint::min();
  Duration newest_rtt_{};
  Duration min_rtt_{};
  // A packet was overtaken on its way; how late the latest of them were, with some room; and how
  // many packets were lost since.
  bool reordering_ = false;
  Duration lateness_{};
  std::uint64_t lost_since_ = 0;
  // When a fragment was last acknowledged.
  TimePoint progress_at_ = TimePoint::min();
  std::uint64_t lost_ = 0;
  bool ect_ = false;
  // How often sent_at() was asked since anything happened to a fragment; and from the
  // kLookupsToIndex-th time on the fragments in flight, ordered, of each the newest copy last.
  mutable std::uint32_t lookups_ = 0;
  mutable std::vector<std::pair<Piece, TimePoint>> copies_;
  link::PathMtu::Told sizes_;
  std::vector<Settled> settled_;
  std::vector<Run> runs_;
  PassedPackets passed_;
};

}  // namespace interneuron::flow
