// The rate to which a policer on the way holds one path, where there is one: a token bucket that
// drops what finds no token, without a queue (RFC 2697). What passes while the bucket is full tells
// nothing of it, be it a train or a message, so it is learnt from losses: after one the bucket is
// empty, and until the next one what arrives is what it was filled with.
//
// Losses by chance do not depend on how fast packets leave. So a path is held to be policed only
// after two rounds of packets in a row that lost much without a queue, evenly as a bucket does and
// not in long runs as a radio does; and no more once rounds that were slower lost as much (the long
// term sampling of BBR, draft-cardwell-iccrg-bbr-congestion-control-00, section 4.3.4.3, decides by
// two intervals of one rate, which needs a sender that never pauses). From then on the rate is a
// cap that rises ever faster while nothing is lost, as CUBIC's window does (RFC 9438), and falls to
// what arrived where more than a few packets of a round are lost.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/units.h"

namespace interneuron::link {

// What became of a data-sized packet that left then; with its IP header.
struct Passage {
  TimePoint left_at{};
  std::uint32_t ip_bytes = 0;
  bool arrived = false;
};

// Owned and fed by the LinkEstimator of the path. What arrived is the peer's word: one that lies
// slows down what is sent to itself. Pure; thread-compatible; constant memory.
class PolicedRate {
 public:
  // In the order in which they left; `queue` is how long packets wait on the way now.
  void passed(TimePoint now, std::span<const Passage> packets, Duration queue);
  // Nothing must leave faster; nothing where nobody polices the path.
  std::optional<DataRate> cap() const { return cap_; }

 private:
  // Packets that are judged together.
  struct Round {
    // When the first of them left.
    TimePoint begin{};
    std::uint32_t packets = 0;
    std::uint32_t lost = 0;
    // Of the packets that left soon after another one: their bytes, how many of those arrived, and
    // for how long such packets left.
    std::size_t left_bytes = 0;
    std::size_t arrived_bytes = 0;
    Duration busy{};
    // What arrived between the first and the last loss of stretches without a pause, and how long
    // these were.
    std::uint32_t told_packets = 0;
    std::size_t told_bytes = 0;
    Duration told{};
    Duration longest_queue{};

    double share_lost() const { return static_cast<double>(lost) / packets; }
  };
  // Packets between two losses without a pause: since the first one, and until the newest loss.
  struct Stretch {
    std::optional<TimePoint> first_lost;
    TimePoint last_lost{};
    std::uint32_t packets = 0;
    std::size_t bytes = 0;
    std::uint32_t told_packets = 0;
    std::size_t told_bytes = 0;
  };
  void add(const Passage& packet);
  void add_to_stretch(const Passage& packet);
  void end_stretch();
  void judge(TimePoint now);
  void suspect(TimePoint now);
  void follow(TimePoint now);
  DataRate measured() const;
  DataRate left_at() const;
  void fall(TimePoint now, DataRate from);
  bool is_measured() const;
  bool is_alike(DataRate rate) const;

  std::optional<DataRate> cap_;
  Round round_;
  Stretch stretch_;
  // When the newest packet left, and the first of which it is to be told.
  TimePoint last_at_ = TimePoint::min();
  TimePoint from_ = TimePoint::min();
  // Rounds in a row that look policed.
  int suspected_ = 0;
  // When the cap last fell, when a round was last judged, and the share of packets that was lost in
  // the round that made it fall.
  TimePoint fell_at_{};
  TimePoint judged_at_{};
  // What was measured last, whether that made the cap fall, and how long the cap stays there.
  DataRate known_{};
  bool exact_ = false;
  bool rose_ = false;
  Duration hold_{};
  // How many packets more were lost since it fell than if half of the losses were the rate's.
  double vain_ = 0;
  bool proved_ = false;
  // The share that is lost without a cap.
  double usual_loss_ = 0;
  // The share that is lost whatever the rate.
  double own_loss_ = 0;
};

}  // namespace interneuron::link
