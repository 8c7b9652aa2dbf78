// The packets that one path has sent: what became of each, as reports and silence tell it, and what
// that says of loss and rate. Pure; thread-compatible; bounded memory; no allocation per packet.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/ring.h"
#include "core/link/delivery_rate.h"
#include "core/wire/packet.h"
#include "interneuron/units.h"

namespace interneuron::flow {

class SentPackets {
 public:
  // Of a message; a packet without one is nobody's to repair.
  struct Piece {
    MessageId message{};
    std::uint16_t index = 0;
    friend bool operator==(const Piece&, const Piece&) = default;
  };
  // What became known of a piece.
  struct Settled {
    Piece piece;
    bool arrived = false;
    bool was_open = false;  // false: taken for lost before, and arrived after all
  };
  // Outcomes of packets in the order of their numbers.
  struct Run {
    bool arrived = false;
    std::uint32_t packets = 0;
  };
  struct Verdicts {
    std::uint64_t acknowledged = 0;
    std::uint64_t lost = 0;
    std::span<const Settled> pieces;  // valid until the next call
    // Certain outcomes, late arrivals included; packets that no report has covered in time are not
    // among them. Valid until the next call.
    std::span<const Run> runs;
    std::optional<TimePoint> newest_sent;  // of those acknowledged
    bool data = false;                     // one of them was data-sized
    // The rate at which the packets of the report's train left here; nothing: back to back.
    // Without train_known they are forgotten.
    std::optional<DataRate> train_sent_at;
    bool train_known = false;
    std::optional<link::DeliveryRate::Sample> delivery;
  };

  explicit SentPackets(std::uint64_t first_number = 1)
      : next_(first_number), first_open_(first_number), first_uncertain_(first_number) {}

  std::uint64_t next_number() const { return next_; }
  // A packet leaves; returns its number.
  std::uint64_t add_small(TimePoint now);
  // Data-sized: it counts for trains, rates and proof of delivery. `ip_bytes`: at IP level.
  // `more_waits`: others wait behind it.
  std::uint64_t add(TimePoint now, std::size_t ip_bytes, bool more_waits,
                    const std::optional<Piece>& piece);

  // A piece is lost after this long in flight, but not while others are acknowledged at most
  // `between` apart: then what is late waits in our own queue.
  struct Silence {
    Duration timeout{};
    Duration between{};
  };
  // `min_rtt`: of the path, for delivery rate samples.
  Verdicts report(TimePoint now, const wire::LinkReport& report, Duration min_rtt,
                  const Silence& silence);
  std::span<const Settled> settle_silent(TimePoint now, const Silence& silence);
  std::optional<TimePoint> silent_at(const Silence& silence) const;

  // The pieces in flight, oldest first; valid until the next call.
  std::span<const Settled> in_flight();
  // When the newest copy of a piece in flight left.
  std::optional<TimePoint> sent_at(const Piece& piece) const;

  std::uint64_t lost() const { return lost_; }
  // What is in flight is void; the numbers go on.
  void reset();

 private:
  enum class Fate : std::uint8_t { kOpen, kArrived, kLost };
  struct Packet {
    std::uint64_t number = 0;
    TimePoint at{};
    link::DeliveryStamp stamp;
    std::uint64_t train_bytes = 0;  // of all data-sized packets up to and with this one
    Piece piece;
    bool has_piece = false;
    bool data_sized = false;
    bool covered = false;  // a report has told that it has not arrived
    Fate fate = Fate::kOpen;
  };
  Packet& at(std::uint64_t number) { return packets_[number - packets_.front().number]; }
  const Packet& at(std::uint64_t number) const {
    return packets_[number - packets_.front().number];
  }
  bool keeps(std::uint64_t number) const {
    return !packets_.empty() && number >= packets_.front().number && number < next_;
  }
  TimePoint silent_at(const Packet& oldest, const Silence& silence) const;
  Packet& record(TimePoint now);
  void trim(TimePoint now);
  void lose(Packet& packet);
  void arrive(TimePoint now, Packet& packet, Verdicts& verdicts);
  void tell_certain(TimePoint now, std::uint64_t largest, Duration timeout);
  void find_train(const wire::LinkReport& report, Verdicts& verdicts);

  Ring<Packet> packets_;  // numbers without a gap, oldest first
  std::uint64_t next_ = 1;
  std::uint64_t first_open_ = 1;       // all before are settled
  std::uint64_t first_uncertain_ = 1;  // the outcome of all before has been told
  std::uint64_t open_data_ = 0;
  std::uint64_t train_bytes_ = 0;
  // The first packet of the newest train that the peer has told of; it may be forgotten above.
  std::uint64_t train_number_ = 0;
  TimePoint train_at_{};
  std::uint64_t train_from_ = 0;  // bytes
  link::DeliveryRate delivery_;
  TimePoint progress_at_ = TimePoint::min();  // the newest acknowledgement of a piece
  std::uint64_t lost_ = 0;
  std::vector<Settled> settled_;
  std::vector<Run> runs_;
};

}  // namespace interneuron::flow
