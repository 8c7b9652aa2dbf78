// What the application knows of a message: its class, its needs, its variants. Nothing here speaks
// of links. Plain values.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "interneuron/nature.h"
#include "interneuron/units.h"

namespace interneuron {

enum class MessageClass : std::uint8_t {
  // The input of a computation: frames, point clouds.
  kData = 0,
  // The output of a computation: lists of objects.
  kResult = 1,
};

// Results of at most this many bytes go over every link on which that costs little, whichever
// policy runs, and the first copy wins. The paper's result message has 5 KB.
inline constexpr std::size_t kSmallResultBytes = 5 * 1024;

// What a plain message needs of the links that carry it, carried in its header (requirement R1 of
// the paper). Policies that weigh links find the weights in Offer::qos.
struct Needs {
  // How much each property of a link matters, in steps of 1/255.
  Nature weights{.delay = 1};
  // Links whose security score is below carry nothing of the message (docs/paper.md, "Nature"), in
  // [0, 1] and in steps of 1/255: 0.5 asks for encrypted packets or a network that the operator
  // trusts.
  double min_security = 0;
  friend bool operator==(const Needs&, const Needs&) = default;
};

// The needs of a message of a round, carried in its header (requirement R1 of the paper).
struct QoS {
  // End-to-end deadline of the round, counted from t0; > 0.
  Duration deadline{};
  // Between two messages of this kind; 0 for sporadic ones.
  Duration period{};
  MessageClass message_class = MessageClass::kData;
  // How much each property of a link matters, in steps of 1/255.
  Nature needs{};
};

// The forms in which a message can travel, from the best to the smallest: raw, down-sampled, …
using Variants = std::vector<Bytes>;

// Variants of a message. No measurement behind this value: it only has to be larger than the number
// of forms that an application prepares of one frame, which is two to four.
inline constexpr std::size_t kMaxVariants = 8;
// Bytes of one variant: an uncompressed RGB frame of 2.5 million pixels fits. It also bounds the
// memory that a receiver keeps for the incomplete messages of a peer.
inline constexpr std::size_t kMaxMessageBytes = 8 * 1024 * 1024;

}  // namespace interneuron
