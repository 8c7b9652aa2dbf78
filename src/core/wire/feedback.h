// Feedback: what a peer tells regularly of each path and of whole messages. docs/wire_format.md,
// "Feedback (type 2)", has the same for others.
//
// Plain values, and functions that read and write them as the body of a packet. What get_feedback()
// does not refuse is within all bounds; whether it is true nobody knows. Pure.
#pragma once

#include <array>
#include <cstdint>

#include "core/wire/bytes.h"
#include "core/wire/header.h"
#include "interneuron/few.h"
#include "interneuron/time.h"
#include "interneuron/units.h"

namespace interneuron::wire {

// How many packets before the largest one an acknowledgement tells of. A receiver reports after 16
// packets at the latest (src/core/peers/feedback_due.h), so that 15 reports in a row may be lost
// before an arrival stays untold.
inline constexpr std::size_t kAckWindow = 256;
using AckBitmap = std::array<std::uint64_t, kAckWindow / 64>;

// What the sender of the feedback has seen on one link.
struct LinkReport {
  LinkId link{};
  // Clock exchange (docs/paper.md, "Clock offset"): s is the newest u received on this link, h the
  // time from receiving it to this u.
  bool has_exchange = false;
  PeerTime s{};
  Duration h{};
  // Acknowledgement: the largest packet number that has arrived, 0 for none, and which of the
  // packets before it have; bit i stands for packet largest - 1 - i.
  std::uint64_t largest = 0;
  AckBitmap bitmap{};
  // Dispersion of the newest train of back-to-back packets: it began with packet train_start and
  // has had train_packets so far; those after the first came in at train_rate (IP headers included,
  // on the wire in kbit/s).
  std::uint64_t train_start = 0;
  std::uint32_t train_packets = 0;
  DataRate train_rate{};
  // What the sender of the feedback believes of its own direction on this link. The rate is 0 while
  // it is not known (on the wire in kbit/s); the loss is the share of packets lost, in 1/65535.
  DataRate rate{};
  std::uint16_t loss = 0;
  // It pays per byte on this link, so we measure it with as few bytes as possible.
  bool metered = false;
  // The delays of packets with data or padding: receive instant by its clock less the packet's
  // stamp, in microseconds modulo 2^32, so that only differences of two delays mean anything.
  // That of the newest such packet, and the largest since the report before.
  bool has_delays = false;
  std::uint32_t newest_delay_us = 0;
  std::uint32_t largest_delay_us = 0;
  // What has arrived on this path so far: packets marked ECT(0), modulo 2^16 because none leaves
  // so, ECT(1) and CE (RFC 3168), both modulo 2^32, and bytes with IP and UDP headers.
  std::uint16_t ect0_packets = 0;
  std::uint32_t ect1_packets = 0;
  std::uint32_t ce_packets = 0;
  std::uint64_t received_bytes = 0;
  friend bool operator==(const LinkReport&, const LinkReport&) = default;
};

inline constexpr std::size_t kMaxReports = 8;
inline constexpr std::size_t kReportBytes = 107;

// A message that is complete at the sender of the feedback.
struct CompleteMessage {
  MessageId message{};
  // How long before `u` it became so, in microseconds; kLongestAgo: that long or longer.
  std::uint32_t ago_us = 0;
  // It was dropped there: it was too late, or of a channel on which a newer one was delivered.
  bool dropped = false;
  // It is kept there for a better variant; what becomes of it is told later. Not both.
  bool kept = false;
  friend bool operator==(const CompleteMessage&, const CompleteMessage&) = default;
};
// The largest value of 30 bits, 17.9 minutes.
inline constexpr std::uint32_t kLongestAgo = 0x3fff'ffff;
// As many as fit beside kMaxReports reports into the smallest datagram (kMinDatagramBytes of
// src/core/peers/peers.cc).
inline constexpr std::size_t kMaxComplete = 32;
inline constexpr std::size_t kMaxRefused = 16;
inline constexpr std::size_t kCompleteBytes = 8;
inline constexpr std::size_t kRefusedBytes = 4;

inline constexpr std::size_t kFeedbackBodyBytes = 17;
// The size of a feedback packet.
constexpr std::size_t feedback_bytes(std::size_t reports, std::size_t complete = 0,
                                     std::size_t refused = 0) {
  return kPacketOverhead + kFeedbackBodyBytes + reports * kReportBytes + complete * kCompleteBytes +
         refused * kRefusedBytes;
}

// What the sender of a feedback can do: decode the symbols of windows.
inline constexpr std::uint16_t kDecodesWindows = 0x0001;

// Held in place, so that feedback is written and parsed without allocating.
using LinkReports = Few<LinkReport, kMaxReports>;

// What a peer tells regularly over each path: acknowledgements, its half of the clock exchange, and
// what it has measured. Also the heartbeat of an idle path.
struct Feedback {
  // When it left, ns on the sender's clock.
  std::int64_t u = 0;
  // The receiver's session as the sender has heard it; 0 while it has not.
  SessionId echo{};
  // What the sender of the feedback can do beyond this version's least; bits that are not known
  // are ignored.
  std::uint16_t features = 0;
  LinkReports reports;
  // Messages that became complete lately, of which nothing more need be sent, and messages of which
  // a piece came lately for which there was no room.
  Few<CompleteMessage, kMaxComplete> complete;
  Few<MessageId, kMaxRefused> refused;
  friend bool operator==(const Feedback&, const Feedback&) = default;
};

void put_feedback(Writer& w, const Feedback& feedback);
// Reads a whole body. False: it is malformed.
bool get_feedback(Reader& r, Feedback& feedback);

}  // namespace interneuron::wire
