// Why a message was refused, and what became of one, in words.
#include "interneuron/send.h"

namespace interneuron {

std::string_view to_string(SendStatus status) {
  switch (status) {
    case SendStatus::kAccepted:
      return "accepted";
    case SendStatus::kNoPeer:
      return "no peer: the one named is not known (any more)";
    case SendStatus::kNoLink:
      return "no link: none to the peer is up";
    case SendStatus::kPolicyRefuses:
      return "the policy refuses: it sends nothing over the links there are";
    case SendStatus::kLinkRestricted:
      return "link restricted: the policy may use none of the links that are up";
    case SendStatus::kCannotArrive:
      return "cannot arrive: by what is believed of the links it would be late";
    case SendStatus::kOverBudget:
      return "over budget: too much is under way already";
    case SendStatus::kTooLarge:
      return "too large: a variant has too many bytes, or there are too many variants";
    case SendStatus::kEmpty:
      return "empty: there is no variant, or one of 0 bytes";
    case SendStatus::kDeadlinePast:
      return "deadline past: it is not after now";
  }
  return "?";
}

std::string_view to_string(Fate fate) {
  switch (fate) {
    case Fate::kDelivered:
      return "delivered";
    case Fate::kLate:
      return "late";
    case Fate::kDropped:
      return "dropped";
    case Fate::kUnknown:
      return "unknown";
  }
  return "?";
}

std::string_view to_string(FateReason reason) {
  switch (reason) {
    case FateReason::kNone:
      return "";
    case FateReason::kCancelled:
      return "cancelled";
    case FateReason::kSuperseded:
      return "superseded";
    case FateReason::kCannotArrive:
      return "cannot arrive";
    case FateReason::kExpired:
      return "expired";
    case FateReason::kRefusedByPeer:
      return "refused by peer";
    case FateReason::kPeerGone:
      return "peer gone";
  }
  return "?";
}

}  // namespace interneuron
