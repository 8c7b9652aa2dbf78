// What the application knows of a message; nothing here speaks of links.
#pragma once

#include <cstdint>
#include <span>

#include "interneuron/nature.h"
#include "interneuron/units.h"

namespace interneuron {

enum class MessageClass : std::uint8_t {
  kData = 0,    // input of a computation: frames, point clouds
  kResult = 1,  // output of a computation: object lists
};

// Results of at most this size go over every link, whichever policy runs: the cost is negligible,
// the first copy wins. The paper's result message has 5 KB.
inline constexpr std::size_t kSmallResultBytes = 5 * 1024;

// The needs of a message, carried in its header (requirement R1 of the paper).
struct QoS {
  Duration deadline{};  // end-to-end, from t0; > 0
  Duration period{};    // between messages of this kind; 0 for sporadic ones
  MessageClass message_class = MessageClass::kData;
  Nature needs{};  // weight per Nature field, in steps of 1/255
};

// The forms in which a message can travel, from the best to the smallest: raw, down-sampled, …
using Variants = std::vector<Bytes>;

inline constexpr std::size_t kMaxVariants = 8;  // chosen; fits a header field
inline constexpr std::size_t kMaxMessageBytes =
    8 * 1024 * 1024;  // chosen: an uncompressed 2.5 Mpixel RGB frame

}  // namespace interneuron
