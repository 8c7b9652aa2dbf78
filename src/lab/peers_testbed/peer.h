// What `bench peers` compares: Interneuron by policy, and what one would take instead. Plain
// values; pure; thread-safe.
#pragma once

#include <span>
#include <string_view>

#include "lab/transports/order.h"

namespace interneuron::peers {

struct Peer {
  // As users write it: "ours_duplicate".
  std::string_view name;
  // One line for people.
  std::string_view about;
  cli::Kind kind{};
  // Transport::mode.
  std::string_view mode;
  // It may use all modems; else the first alone.
  bool all_modems = false;
  // Every message has a smaller variant, too.
  bool variants = false;
  // What it does depends on the deadline of a message, so that each deadline is a run of its own.
  bool heeds_deadline = false;
};

// In the order in which they are shown: a policy of Interneuron is one line more here.
std::span<const Peer> all_peers();

// The peer of that name; nullptr: there is none.
const Peer* peer_of(std::string_view name);

}  // namespace interneuron::peers
