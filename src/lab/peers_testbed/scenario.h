// Under which conditions `bench peers` compares, and the runs that follow from what a user chose.
//
// A vehicle with two modems sends to a roadside unit; each modem has a link of its own, so nothing
// is shared. Plain values; pure; thread-safe. No errors: names were checked before.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "lab/emu/profile.h"
#include "lab/transports/order.h"

namespace interneuron::peers_testbed {

// What `bench peers` compares: Interneuron by policy, and what one would take instead. Plain
// values; pure; thread-safe.
struct Peer {
  // As users write it: "ours_duplicate".
  std::string_view name;
  // One line for people.
  std::string_view about;
  transports::Kind kind{};
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

inline constexpr std::size_t kLinks = 2;

struct Scenario {
  // As users write it: "hole".
  std::string_view name;
  // One line for people.
  std::string_view about;
  // Makes the profiles of the first link and the second.
  std::array<emu::LinkProfile, kLinks> (*links)();
  // Nothing passes over the first link for so long, from the middle of the run on; 0: no hole.
  Duration hole{};
};

// In the order in which they are shown.
std::span<const Scenario> all_scenarios();

// The scenario of that name; nullptr: there is none.
const Scenario* scenario_of(std::string_view name);

// Messages of a few packets, of a compressed frame, and of what is not compressed.
inline constexpr std::array<std::size_t, 3> kSizes{5'000, 128 * 1024, 1'000'000};
inline constexpr std::array<Duration, 3> kDeadlines{
    std::chrono::milliseconds(100), std::chrono::milliseconds(150), std::chrono::milliseconds(300)};

// 10 messages a second, as of a camera, or as many as the slower link can carry.
Duration period_of(std::size_t message_bytes);

// Sizes of what is offered of a message to this peer, from the whole one on: the smaller variant,
// if there is one, has a quarter of the bytes.
std::vector<std::size_t> variant_bytes(const Peer& peer, std::size_t message_bytes);

// One run: a testbed, a peer, messages.
struct Run {
  const Scenario* scenario = nullptr;
  const Peer* peer = nullptr;
  std::size_t message_bytes = 0;
  std::size_t messages = 0;
  // By which messages are judged. The largest is what the peer is told; there is one where that
  // makes a difference.
  std::vector<Duration> deadlines;
  std::uint64_t seed = 1;
  // As in transports::Transport.
  TransportKind datagrams = TransportKind::kUdp;

  Duration period() const { return period_of(message_bytes); }
  // Messages begin for this long.
  Duration length() const { return period() * static_cast<std::int64_t>(messages); }
};

// What a user chose. Empty lists stand for all.
struct Choice {
  std::vector<const Scenario*> scenarios;
  std::vector<const Peer*> peers;
  std::vector<std::size_t> sizes;
  std::vector<Duration> deadlines;
  std::size_t messages = 100;
  // For how long messages begin in each run, in place of how many they are.
  std::optional<Duration> length{};
  std::uint64_t seed = 1;
};

// By scenario, then by size, then by peer, then by deadline.
std::vector<Run> runs_of(const Choice& choice);

}  // namespace interneuron::peers_testbed
