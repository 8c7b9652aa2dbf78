// The two ends of one subflow, and the stream of a connection at its receiver. Pure;
// thread-compatible; no errors.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/ring.h"
#include "lab/foreign/congestion.h"
#include "lab/foreign/segment.h"

namespace interneuron::foreign {

// A connection's ordered byte stream at the receiver: pieces come in any order and perhaps twice,
// and the application reads what is there without a gap. A message is there when all of it, and of
// every message before it, can be read: the head of the line blocks. Memory: one entry per piece
// that waits behind a gap.
class StreamReceiver {
 public:
  void add(const Piece& piece);
  // The next message that can be read whole, in their order.
  std::optional<std::uint32_t> poll_message();
  std::uint64_t readable_bytes() const { return next_; }

 private:
  void read(const Piece& piece);

  std::uint64_t next_ = 0;
  // By offset.
  std::map<std::uint64_t, Piece> waiting_;
  Ring<std::uint32_t> whole_;
};

// The least of Linux (TCP_DELACK_MIN); RFC 1122, section 4.2.3.2 allows up to 500 ms.
inline constexpr Duration kAckDelay = std::chrono::milliseconds(40);

// The receiving end of one subflow: what has arrived, and what is acknowledged when. Every second
// segment in order at once, every one out of order at once, the rest after kAckDelay (RFC 5681,
// section 4.2); the blocks of what is out of order newest first (RFC 2018). Memory: one entry per
// gap.
class SubflowReceiver {
 public:
  // A segment has arrived; `marked` by a queue on its way.
  void segment(Duration now, const DataSegment& segment, bool marked);
  // The instant of next_timeout() has come.
  void handle_timeout(Duration now);
  // The acknowledgement that leaves now, if any.
  std::optional<AckSegment> poll();
  std::optional<Duration> next_timeout() const { return timer_; }

 private:
  void add(const Range& range);
  void advance();

  std::uint64_t next_ = 0;
  // Beyond next_: newest first, none touches another.
  std::vector<Range> gaps_beyond_;
  bool due_ = false;
  // Segments in order that no acknowledgement has covered.
  int held_ = 0;
  Duration echo_{};
  std::optional<Duration> timer_{};
  bool congestion_seen_ = false;
};

// The sending end of one subflow: what is in flight, what has arrived, what is lost and to be sent
// again, and when. It numbers pieces of a stream and hears acknowledgements.
//
//   loss        a segment is lost when one has arrived that was sent three or more later (RFC 6675
//               with the order of sending in place of that of sequence, as RFC 9002 has it, so
//               that a lost retransmission is seen, too) or a quarter of the round trip later
//               (RFC 8985), or after the retransmission timeout (RFC 6298)
//   tail        the last segment is sent once more when nothing is heard for two round trips
//               (tail loss probe, RFC 8985, section 7)
//   marks       are answered as losses, once a window (RFC 3168)
//   rate        samples as of draft-cheng-iccrg-delivery-rate-estimation-02
//
// Connections are open from the start: there is no handshake. Memory: 100 bytes per segment in
// flight, which the window bounds.
class SubflowSender {
 public:
  explicit SubflowSender(std::unique_ptr<CongestionControl> control)
      : control_(std::move(control)) {}

  // A full segment may leave: window and pacing allow it.
  bool can_send(Duration now) const;
  // Something that was lost waits to be sent again.
  bool has_lost() const { return lost_bytes_ > 0; }
  // Sends the earliest segment that is lost again. Requires has_lost().
  DataSegment send_again(Duration now);
  // Sends a new piece.
  DataSegment send(Duration now, const Piece& piece);
  // The application has no more to send although this subflow could.
  void application_is_idle() { limited_until_ = delivered_ + in_flight_ + 1; }

  void acknowledged(Duration now, const AckSegment& ack);
  // The instant of next_timeout() has come. Pieces that were in flight when the retransmission
  // timeout ran out are returned: another subflow may carry them.
  std::vector<Piece> handle_timeout(Duration now);
  // Loss timers, and pacing while `wants_to_send`.
  std::optional<Duration> next_timeout(bool wants_to_send) const;

  // Smoothed; 0 while nothing was measured.
  Duration rtt() const { return smoothed_; }
  std::size_t in_flight() const { return in_flight_; }
  const CongestionControl& control() const { return *control_; }
  std::uint64_t timeouts() const { return timeouts_; }

 private:
  struct Sent {
    std::uint64_t sequence = 0;
    Piece piece;
    // Counts all that this subflow has sent.
    std::uint64_t order = 0;
    Duration at{};
    // How much had been delivered when it was sent, when the last of that was, and when that had
    // been sent.
    std::uint64_t delivered_before = 0;
    Duration delivered_at{};
    Duration first_sent_at{};
    bool application_limited = false;
    bool again = false;
    bool sacked = false;
    bool lost = false;
  };
  // What one acknowledgement adds up to.
  struct Heard {
    std::size_t bytes = 0;
    Sent newest;
  };

  Duration retransmission_timeout() const;
  void stamp(Sent& sent, Duration now);
  static DataSegment segment(const Sent& sent);
  void leaves_flight(const Sent& sent);
  void hear(Sent& sent, Heard& heard);
  Heard hear_all(const AckSegment& ack);
  void find_losses(Duration now);
  void measure_rtt(Duration rtt);
  Delivery delivery(Duration now, const Heard& heard, Duration rtt);
  void arm(Duration now);
  void reduce(Duration now);

  std::unique_ptr<CongestionControl> control_;
  // By sequence: what was sent and not acknowledged as a whole.
  std::deque<Sent> sent_;
  std::uint64_t next_sequence_ = 0;
  std::uint64_t order_ = 0;
  std::uint64_t newest_heard_order_ = 0;
  Duration newest_heard_at_{};
  std::size_t in_flight_ = 0;
  std::size_t lost_bytes_ = 0;
  // Bytes known to have arrived, and since when.
  std::uint64_t delivered_ = 0;
  Duration delivered_at_{};
  Duration first_sent_at_{};
  std::uint64_t limited_until_ = 0;
  // The round trip ends when what was sent after this has arrived.
  std::uint64_t round_ends_ = 0;
  std::size_t peak_in_flight_ = 0;
  std::size_t last_peak_in_flight_ = 0;
  // No further reduction until this sequence is acknowledged.
  std::uint64_t reduced_until_ = 0;
  bool tell_reduced_ = false;
  Duration smoothed_{};
  Duration variation_{};
  // By how much the retransmission timeout is longer, as a power of two.
  int backoff_ = 0;
  std::optional<Duration> timer_{};
  bool timer_is_probe_ = false;
  bool probed_ = false;
  Duration next_departure_{};
  Duration last_sent_{};
  std::uint64_t timeouts_ = 0;
};

}  // namespace interneuron::foreign
