// Explicit congestion notification on one path (ECN, RFC 3168): whether packets that say that we
// understand marks get through with what they say, and how many of them queues have marked.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/link.h"
#include "interneuron/time.h"

namespace interneuron::link {

// The two ECN bits of an IP header.
inline constexpr std::uint8_t kNotEct = 0;
inline constexpr std::uint8_t kEct1 = 1;
inline constexpr std::uint8_t kCe = 3;

// Packets with messages or padding leave as ECT(1), by which queues for L4S know who answers many
// small marks (RFC 9331); a classic queue marks them as it marks ECT(0). The peer counts what
// arrives. As RFC 9000 §13.4.2 asks, the counts are checked against what is acknowledged:
//
//   bleached  fewer arrived with a mark or with ECT(1) than arrived: something on the way clears
//             the bits, or the peer's kernel does not show them
//   rewritten one arrived with ECT(0), with which none leaves: whoever changes that may change the
//             rest, and queues behind it take us for another kind of sender
//   mangled   for kMangled not one packet came unmarked: whoever halves its rate every round trip
//             for so long and is still marked each time is not told of a queue that it could drain
//   dropped   not one of them arrived while packets without ECT did, for kDropped: something on the
//             way takes the bits for a fault
//
// After any of these packets leave without ECT and marks count for nothing, until the path leads
// elsewhere.
//
// Owned and fed by the Path (src/core/peers). Counts are the peer's word: one that invents marks
// slows down what is sent to itself, one that hides them gets what a sender without ECN would send,
// which heeds queues and losses. Who can change bits on the way can as well drop the packets. Pure;
// thread-compatible; constant memory; never throws.
class PathEcn {
 public:
  // So many packets have to arrive before a verdict other than bleached: RFC 9000,
  // section 13.4.2.1, tests with ten.
  static constexpr std::uint32_t kTestPackets = 10;
  // No measurement behind this value: forty round trips of 50 ms, and short beside a drive.
  static constexpr Duration kMangled = std::chrono::seconds(2);
  // The longest routine stall of a radio is 800 ms (docs/constants.md, "States of a path").
  static constexpr Duration kDropped = std::chrono::seconds(1);

  // What a report tells anew: packets of ours that came with ECT(1) or a mark, and the marked ones
  // of these.
  struct Told {
    std::uint32_t arrived = 0;
    std::uint32_t marked = 0;
  };

  EcnState state() const { return state_; }
  // The ECN bits to send with.
  std::uint8_t bits() const {
    return state_ == EcnState::kTesting || state_ == EcnState::kWorks ? kEct1 : kNotEct;
  }

  // The path leads elsewhere: it is tested anew. What the peer has counted so far was before.
  void moved();
  // A packet leaves with these bits.
  void sent(TimePoint now) {
    if (acknowledged_ > 0 || ++unheard_ > kTestPackets) return;
    if (unheard_ == 1) first_sent_ = now;
    tested_ = now;
  }
  // What a report of the peer tells.
  struct Report {
    // The peer's counts as of the largest packet number that has arrived there.
    std::uint64_t largest = 0;
    std::uint16_t ect0 = 0;
    std::uint32_t ect1 = 0;
    std::uint32_t ce = 0;
    // How many packets that left with ECT it acknowledges for the first time.
    std::uint32_t acknowledged = 0;
    // When the newest packet of any kind that it acknowledges left.
    std::optional<TimePoint> newest_sent;
  };
  Told report(TimePoint now, const Report& report);

 private:
  bool is_dropped(TimePoint now, const Report& report) const;
  bool is_mangled(TimePoint now, std::uint32_t unmarked, std::uint32_t marked);

  EcnState state_ = EcnState::kTesting;
  // Packets with ECT before any was acknowledged, as far as they are looked at; when the first and
  // the last of these left.
  std::uint32_t unheard_ = 0;
  TimePoint first_sent_{};
  TimePoint tested_{};
  // What the newest report has told.
  std::uint64_t largest_ = 0;
  std::uint16_t ect0_ = 0;
  std::uint32_t ect1_ = 0;
  std::uint32_t ce_ = 0;
  // Since the peer began to count: packets that were acknowledged, and those with ECT(1) or a mark.
  std::uint64_t acknowledged_ = 0;
  std::uint64_t counted_ = 0;
  // Marked packets since the last one without a mark, and since when there are any.
  std::uint64_t marked_in_a_row_ = 0;
  TimePoint marked_since_{};
};

}  // namespace interneuron::link
