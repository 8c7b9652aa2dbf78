// Plain messages: one way, each with a deadline of its own, no answer needed. docs/messages.md is
// the page to read first; rounds (pipeline.h) are a layer of their own above the same links.
//
// send() answers at once: the message is accepted, or why not. Every accepted message has exactly
// one fate, told by MessageFate: at the latest one round trip and 50 ms after its deadline. The
// other end gets it as Message, by its deadline or not at all. Plain values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron {

// Names an accepted message within its endpoint; counts from 1.
using SendId = Id<struct SendTag, std::uint64_t>;

// Deadlines that are further away count as this. Packets carry them in microseconds, in 32 bits.
inline constexpr Duration kLongestDeadline = std::chrono::hours(1);

struct SendOptions {
  // From now until the message is to be at the other end, > 0.
  Duration deadline = std::chrono::milliseconds(100);
  // The name of a registered policy, which decides which variants go over which links.
  std::string policy = "down_sampling";
  // The application's own numbering.
  std::uint16_t channel = 0;
  // 0 matters least; over a loaded link what matters more leaves first. Travels with the message.
  std::uint8_t importance = 128;
  // Only the newest message of this channel counts: one that was sent before another one that has
  // been delivered is not delivered any more, and what has not left of it is dropped.
  bool newest_only = false;
  // > 0: the messages of this channel are handed over in their order. One that is there before
  // those sent before it waits for them for so long at most, and not beyond its deadline; one that
  // is still missing then is dropped when it comes. Nothing: each is handed over when it is there.
  Duration in_order_within{};
  // It has no deadline but kLongestDeadline, and takes what all others leave: it leaves after them
  // whatever they are, and only while it fills no queue that they would wait in. Importance and
  // deadline above count for nothing then.
  bool bulk = false;
  // Which links are wanted.
  Needs needs{};
};

enum class SendStatus : std::uint8_t {
  kAccepted,
  // The peer is not known (any more).
  kNoPeer,
  // No link to the peer is up: none was heard of yet, or all are lost.
  kNoLink,
  // The policy decided to send nothing although a link is up.
  kPolicyRefuses,
  // Links are up, but none that the policy may use (its security floor, or untrusted).
  kLinkRestricted,
  // By what is believed of the links no variant would be there by the deadline.
  kCannotArrive,
  // The messages under way hold as many bytes, or are as many, as may be.
  kOverBudget,
  // A variant has more than kMaxMessageBytes, or there are more than kMaxVariants.
  kTooLarge,
  // There is no variant, or one of 0 bytes.
  kEmpty,
  // The deadline is not after now.
  kDeadlinePast,
};
// One line for people: "accepted", "no peer: …".
std::string_view to_string(SendStatus status);

struct SendResult {
  SendStatus status{};
  // Where it was accepted.
  SendId id{};
  // How long from now until the first variant should be at the other end, by what is believed of
  // the links; also told with kCannotArrive. Nothing: not known.
  std::optional<Duration> expected{};
  // With kAccepted: how likely it is, in [0, 1], that a variant will be at the other end by the
  // deadline, as far as what became of earlier messages to this peer tells. With kCannotArrive: how
  // likely it would be if it was sent nevertheless. Nothing with any other status.
  std::optional<double> on_time{};
  // Why the policy refuses, one line for people; empty otherwise. Refers to a literal.
  std::string_view reason{};

  bool accepted() const { return status == SendStatus::kAccepted; }
};

// A message of a peer is there. Each is told once, in the best of its variants that came in time
// (Policy::merge() of the sender's policy may say otherwise); in the order of arrival, which need
// not be that of sending.
struct Message {
  PeerId peer{};
  std::uint16_t channel = 0;
  std::uint8_t importance = 0;
  // Which variant it is; 0 is the best.
  std::uint8_t variant = 0;
  // From send() at the other end until now, and how wrong that may be: half the smallest round trip
  // of late. Nothing while the other's clock is not known, which takes a round trip after it was
  // first heard.
  std::optional<Duration> age{};
  Duration age_error{};
  // As the other end has stated them.
  Needs needs{};
  Bytes bytes;
};

enum class Fate : std::uint8_t {
  // A variant was handed to the application at the other end.
  kDelivered,
  // It was complete at the other end, but too late, and was dropped there.
  kLate,
  // It was given up here or refused there; MessageFate::reason says why.
  kDropped,
  // The peer did not say what became of it.
  kUnknown,
};
// "delivered", "late", "dropped", "unknown".
std::string_view to_string(Fate fate);

enum class FateReason : std::uint8_t {
  kNone,
  // cancel() was called. What had left may be delivered nevertheless.
  kCancelled,
  // A newer message of the channel took its place before it had left.
  kSuperseded,
  // What is believed of the links changed after it was accepted: it cannot arrive any more.
  kCannotArrive,
  // It was not complete at the other end by its deadline.
  kExpired,
  // The other end had no room for it.
  kRefusedByPeer,
  // The peer has begun a new life, or was forgotten.
  kPeerGone,
};
// "", "cancelled", "superseded", "cannot arrive", "expired", "refused by peer", "peer gone".
std::string_view to_string(FateReason reason);

// What became of an accepted message. Told once for each.
struct MessageFate {
  SendId id{};
  PeerId peer{};
  std::uint16_t channel = 0;
  Fate fate{};
  FateReason reason = FateReason::kNone;
  // Where the fate is kDelivered or kLate: the variant that was delivered, or the first that was
  // late; how long it took from send() on until it was there, by the own clock, and how wrong that
  // may be. Where it waited there for a better one it was handed over later.
  std::uint8_t variant = 0;
  Duration age{};
  Duration age_error{};
};

// A message of this channel was refused with kNoLink, kCannotArrive or kOverBudget, and one of the
// same size and deadline would be accepted now. Told once after each row of refusals.
struct CanSend {
  PeerId peer{};
  std::uint16_t channel = 0;
};

}  // namespace interneuron
