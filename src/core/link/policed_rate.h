// The rate to which a policer on the way holds a path, where there is one: a token bucket that
// drops what finds no token (RFC 2697). It makes no queue, and what passes while the bucket is full
// tells nothing of the rate, be it a train or a whole message. But at a loss the bucket is empty:
// what arrives from one loss to the next, without a pause in which it could fill, is what it was
// filled with.
//
// Losses by chance look alike once, but do not depend on how fast packets leave. So a path is held
// to be policed after two rounds of packets that lost much without a queue, the second of which had
// left after the first was known, and between whose losses the same rate arrived (BBR decides by
// two such intervals, draft-cardwell-iccrg-bbr-congestion-control-00, section 4.3.4.3, "long-term"
// sampling). From then on that rate is a cap. It is given up where as much is lost below it as
// before; else it stays, longer each time that it proves right, and then rises ever faster until
// packets are lost again.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "interneuron/units.h"

namespace interneuron::link {

// What became of a data-sized packet that left then; its bytes are those with IP headers.
struct Passage {
  TimePoint left_at{};
  std::uint16_t ip_bytes = 0;
  bool arrived = false;
};

// Owned and fed by the LinkEstimator of the path. What arrived is the peer's word: one that lies
// slows down what is sent to itself. Pure; thread-compatible; constant memory; never throws.
class PolicedRate {
 public:
  // In the order in which they left; `queue` is how long packets wait on the way now.
  void passed(TimePoint now, std::span<const Passage> packets, Duration queue);
  // Nothing should leave faster; nothing where no policer is known.
  std::optional<DataRate> cap() const { return cap_; }
  // When packets were last judged.
  TimePoint judged_at() const { return judged_at_; }

 private:
  // Packets that are judged together.
  struct Round {
    // When the first of them left.
    TimePoint begin{};
    std::uint32_t packets = 0;
    std::uint32_t lost = 0;
    // Those that left soon after another one: how many, their bytes, those of them that arrived,
    // and how long it took them to leave.
    std::uint32_t close = 0;
    std::size_t left_bytes = 0;
    std::size_t arrived_bytes = 0;
    Duration busy{};
    // What arrived between the first and the last loss of stretches without a pause, and how long
    // these were.
    std::uint32_t between = 0;
    std::size_t between_bytes = 0;
    Duration between_losses{};
    // The longest queue that there was when losses were told of.
    Duration queue{};

    double share_lost() const { return static_cast<double>(lost) / packets; }
    DataRate left_at() const;
    DataRate arrived_at() const;
    // The bytes that arrived beyond what a bucket that fills at this rate got meanwhile.
    double beyond(DataRate rate) const;
    // Whether enough arrived between losses to know the rate, and that rate.
    bool is_measured() const;
    DataRate measured() const;
  };
  // Packets without a pause between them: what arrived after the first loss, and how much of that
  // before the newest one.
  struct Stretch {
    std::optional<TimePoint> first_lost;
    TimePoint last_lost{};
    std::uint32_t packets = 0;
    std::size_t bytes = 0;
    std::uint32_t between = 0;
    std::size_t between_bytes = 0;
  };
  bool is_complete(const Passage& next) const;
  void add(const Passage& packet);
  void end_stretch();
  void judge(TimePoint now);
  void suspect(TimePoint now);
  void follow(TimePoint now);
  void test();
  void fall(TimePoint now, DataRate from);
  void rise(TimePoint now);
  std::uint32_t least_lost() const;
  bool is_onset() const;

  std::optional<DataRate> cap_;
  Round round_;
  Stretch stretch_;
  // When the newest packet left, and from when on packets count: what was on its way when the cap
  // changed says nothing of the new one.
  TimePoint last_at_ = TimePoint::min();
  TimePoint from_ = TimePoint::min();
  TimePoint judged_at_{};
  // Rounds in a row that look policed.
  int suspected_ = 0;
  // What passed beyond the rate in the newest of them, in bytes.
  double passed_ = 0;
  // What was measured last; zero: nothing.
  DataRate known_{};
  // To what and when the cap last fell, for how long it stays there, whether that was to what the
  // same round has measured, and whether it rose since then.
  DataRate fell_to_{};
  TimePoint fell_at_{};
  Duration stays_{};
  bool exact_ = false;
  bool rose_ = false;
  // The share that is lost without a cap, and that which is lost whatever the rate.
  double usual_loss_ = 0;
  double own_loss_ = 0;
  // How many packets more were lost below the cap than half of the usual loss, and whether they
  // were so few that there is a policer.
  double vain_ = 0;
  bool proved_ = false;
};

}  // namespace interneuron::link
