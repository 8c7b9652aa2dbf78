// What is measured under load: a bottleneck, how many vehicles send messages with deadlines through
// it, how much they offer, and by which transport. Groups are families of such scenarios
// (docs/load.md has them all with their reasons).
//
// Offered load is IP bytes over the rate of the bottleneck, by Interneuron's own framing, so that
// every transport gets the same messages at the same instants. Plain values; pure; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/units.h"

namespace interneuron::load {

enum class Peer : std::uint8_t {
  // Endpoints with the policy best_link: every message has one variant.
  kOurs,
  // Endpoints with the policy down_sampling: every message has a smaller variant, too.
  kOursVariants,
  // Each message at once in plain datagrams, without repair (src/lab/foreign/transports.h).
  kUdp,
  // TCP with CUBIC; with a rate-based control after BBR; MPTCP with CUBIC over two modems in the
  // same cell (src/lab/foreign/transports.h).
  kCubic,
  kBbrLike,
  kMptcpLike,
  // The kernel's own, on the testbed alone: TCP with CUBIC and with BBR, and MPTCP with CUBIC over
  // two modems in the same cell.
  kTcpCubic,
  kTcpBbr,
  kMptcp,
};

inline constexpr std::size_t kPeers = 9;

// The conditions of all runs. For everybody to get to know each other and to measure the link;
// cross traffic begins so long before the messages.
inline constexpr Duration kWarmUp = std::chrono::seconds(2);
inline constexpr Duration kCrossBegins = std::chrono::seconds(1);
// Vehicles that enter a cell do so up to so much apart. No measurement behind this value: fifty
// then need 2.5 s, as long as a row of cars needs to come round a corner.
inline constexpr Duration kMostApart = std::chrono::milliseconds(100);
// A vehicle that has joined a crowded cell should have found its share after so long: its first
// messages are told apart from the others. No measurement behind this value: it is what others may
// notice of a newcomer.
inline constexpr Duration kEarly = std::chrono::seconds(2);
// A camera of 10 frames per second.
inline constexpr Duration kCameraPeriod = std::chrono::milliseconds(100);
// The smaller variant has a quarter of the bytes.
inline constexpr std::size_t kSmallerVariant = 4;
// The life of the roadside unit.
inline constexpr std::uint32_t kRoadSession = 0x524f4144;
// In virtual time, and on real sockets.
std::span<const Peer> modelled_peers();
std::span<const Peer> real_peers();

// The names as users write them, by Peer: "ours", "ours_variants".
std::span<const std::string_view> peer_names();
std::string_view name_of(Peer peer);
// The peer of that name, if there is one.
std::optional<Peer> peer_of(std::string_view name);

// The rate of the bottleneck falls to `rate` for `length` and is what it was again.
struct Dip {
  // Since the first message.
  Duration at{};
  Duration length{};
  DataRate rate{};
};

// Where a queue for L4S begins to mark: 1 ms, as in the AQM of RFC 9332, appendix A.1.
inline constexpr Duration kL4sStep = std::chrono::milliseconds(1);

// One run.
struct Scenario {
  std::string group;
  // Tells the scenarios of a group apart: "20mbit-30ms".
  std::string name;
  Peer peer{};
  // What is offered, as a share of what the bottleneck carries.
  double load = 1;
  std::size_t vehicles = 1;
  DataRate capacity{};
  // How long a full queue takes to drain at this rate.
  Duration queue{};
  // The queue is managed by CoDel; else packets are dropped at its tail.
  bool codel = false;
  // Packets of L4S that wait longer than kL4sStep are marked.
  bool l4s = false;
  // Without any queue.
  Duration one_way{};
  // From the instant at which a message is handed over.
  Duration deadline{};
  // Between two messages of a vehicle.
  Duration period{};
  std::size_t message_bytes = 0;
  // The size of the smaller variant, for those peers that have one.
  std::size_t small_bytes = 0;
  // Messages begin for this long.
  Duration length{};
  std::optional<Dip> dip{};
  // The last vehicle begins so long after the others; else all begin together, or each up to
  // kMostApart after the one before it.
  std::optional<Duration> late{};
  bool is_spread = false;
  // TCP flows with unlimited demand through the same bottleneck, with CUBIC or with BBR: the model
  // that Peer::kBbrLike is, or the kernel's.
  std::size_t cross_flows = 0;
  bool is_cross_bbr = false;
  std::uint64_t seed = 1;
  // Our own endpoints have keys; on the testbed they always do.
  bool is_encrypted = false;
};

// Sizes of the variants that the transport of this scenario offers.
std::vector<std::size_t> variant_bytes(const Scenario& scenario);

// When each vehicle joins, since the first one does.
std::vector<Duration> joins(const Scenario& scenario);

// When the first message of each vehicle begins, since the first of all may: kWarmUp after it has
// joined. Each vehicle has a phase of its own, for no transport is made for vehicles that all send
// at one instant.
std::vector<Duration> first_messages(const Scenario& scenario);

// From when the first message may begin until the last one may: the length, from when the last
// vehicle has joined.
Duration span_of(const Scenario& scenario);

// Until kEarly after the last vehicle has joined, since the first message may begin; zero where
// vehicles join together, and where nothing would come after it.
Duration joining_time(const Scenario& scenario);

// What a message takes on the wire, in IP bytes, by Interneuron's framing.
std::size_t ip_bytes_of(std::size_t message_bytes);

// The share of the wire that is left for messages of this size.
double payload_share(std::size_t message_bytes);

struct Group {
  std::string_view name;
  // One line for people.
  std::string_view about;
  // Whether `loads` of a Choice applies to it.
  bool takes_loads = false;
};
// In the order in which they are shown.
std::span<const Group> groups();

// What a user chose. Empty lists stand for the defaults: all modelled peers, the group's own loads.
struct Choice {
  std::vector<Peer> peers;
  std::vector<double> loads;
  // How long messages begin.
  Duration length = std::chrono::seconds(20);
  std::uint64_t seed = 1;
  bool is_encrypted = false;
  bool is_spread = false;
  bool is_cross_bbr = false;
};

// The runs of a group; none for a name that is no group's.
std::vector<Scenario> scenarios(std::string_view group, const Choice& choice);

}  // namespace interneuron::load
