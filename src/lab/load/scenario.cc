#include "lab/load/scenario.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "interneuron/sizes.h"

namespace interneuron::load {
namespace {

using namespace std::chrono_literals;

// The conditions of all scenarios: a deadline of one and a half frames of a camera, and half the
// round trip of a 5G modem with a good connection (docs/constants.md).
constexpr Duration kDeadline = 150ms;
constexpr Duration kOneWay = 20ms;
// A camera of 10 frames per second.
constexpr Duration kFrame = 100ms;
// A queue as of a managed cell, and one as cellular base stations are known to have.
constexpr std::array<Duration, 2> kQueues{30ms, 300ms};
// The smaller variant has a quarter of the bytes.
constexpr std::size_t kSmaller = 4;

constexpr std::array<std::string_view, kPeers> kPeerNames{"ours", "ours_variants"};

constexpr std::array<Group, 3> kGroups{{
    {"rate", "One vehicle, messages that take a third of the deadline, ever more often", true},
    {"size", "One vehicle, 10 messages a second, ever larger", true},
    {"dip", "60 Mbit/s fall to 6 for 3 s and come back", false},
}};

// A link and the messages that take about a third of the deadline on it.
struct Bottleneck {
  double mbit;
  std::size_t message_bytes;
};
constexpr std::array<Bottleneck, 2> kBottlenecks{{{20, 48 * 1024}, {60, 128 * 1024}}};

constexpr std::array kRateLoads{0.5, 0.8, 0.95, 1.05, 1.2, 1.5, 2.0, 3.0};
constexpr std::array kSizeLoads{0.95, 1.0, 1.05, 1.1, 1.2};

std::vector<double> or_default(const std::vector<double>& chosen, std::span<const double> own) {
  return chosen.empty() ? std::vector<double>(own.begin(), own.end()) : chosen;
}

std::string named(double mbit, Duration queue) {
  return std::to_string(std::lround(mbit)) + "mbit-" + std::to_string(queue / 1ms) + "ms";
}

Scenario base(const Choice& choice, std::string_view group, double mbit, Duration queue) {
  Scenario s;
  s.group = group;
  s.name = named(mbit, queue);
  s.capacity = DataRate::mbit(mbit);
  s.queue = queue;
  s.one_way = kOneWay;
  s.deadline = kDeadline;
  s.length = choice.length;
  s.seed = choice.seed;
  return s;
}

// How often each of so many vehicles sends a message of this size for this load.
Duration period_for(const Scenario& s) {
  const Duration on_wire = s.capacity.transmit_time(ip_bytes_of(s.message_bytes));
  return Duration{std::llround(static_cast<double>(on_wire.count()) *
                               static_cast<double>(s.vehicles) / s.load)};
}

// The size of message for this load at the period that is set.
std::size_t bytes_for(const Scenario& s) {
  const double wire = static_cast<double>(s.capacity.bits_per_second) / 8 * s.load *
                      std::chrono::duration<double>(s.period).count();
  // The framing of messages of this size hardly depends on the size.
  return static_cast<std::size_t>(wire * payload_share(static_cast<std::size_t>(wire)));
}

std::vector<Scenario> rate(const Choice& choice) {
  std::vector<Scenario> out;
  for (const Bottleneck& b : kBottlenecks) {
    for (const Duration queue : kQueues) {
      for (const double load : or_default(choice.loads, kRateLoads)) {
        Scenario s = base(choice, "rate", b.mbit, queue);
        s.load = load;
        s.message_bytes = b.message_bytes;
        s.period = period_for(s);
        out.push_back(std::move(s));
      }
    }
  }
  return out;
}

std::vector<Scenario> size(const Choice& choice) {
  std::vector<Scenario> out;
  for (const Duration queue : kQueues) {
    for (const double load : or_default(choice.loads, kSizeLoads)) {
      Scenario s = base(choice, "size", 20, queue);
      s.load = load;
      s.period = kFrame;
      s.message_bytes = bytes_for(s);
      out.push_back(std::move(s));
    }
  }
  return out;
}

std::vector<Scenario> dip(const Choice& choice) {
  constexpr double kMbit = 60;
  constexpr std::size_t kWhole = 128 * 1024;
  constexpr Dip kDip{.at = 3s, .length = 3s, .rate = DataRate::mbit(6)};
  // Long enough to see what becomes of the vehicle after the dip.
  constexpr Duration kAfter = 6s;
  std::vector<Scenario> out;
  for (const std::size_t small : {std::size_t{16 * 1024}, std::size_t{1024}}) {
    Scenario s = base(choice, "dip", kMbit, kQueues[1]);
    s.name += "-" + std::to_string(small / 1024) + "kib";
    s.message_bytes = kWhole;
    s.small_bytes = small;
    s.period = kFrame;
    s.load = static_cast<double>(s.capacity.transmit_time(ip_bytes_of(kWhole)).count()) /
             static_cast<double>(kFrame.count());
    s.dip = kDip;
    s.length = std::max(choice.length, kDip.at + kDip.length + kAfter);
    out.push_back(std::move(s));
  }
  return out;
}

}  // namespace

std::span<const std::string_view> peer_names() { return kPeerNames; }

std::string_view name_of(Peer peer) { return kPeerNames[static_cast<std::size_t>(peer)]; }

std::optional<Peer> peer_of(std::string_view name) {
  const auto it = std::ranges::find(kPeerNames, name);
  if (it == kPeerNames.end()) return std::nullopt;
  return static_cast<Peer>(it - kPeerNames.begin());
}

std::span<const Group> groups() { return kGroups; }

std::size_t ip_bytes_of(std::size_t message_bytes) {
  const std::size_t pieces =
      std::max<std::size_t>(1, (message_bytes + kMaxPieceBytes - 1) / kMaxPieceBytes);
  return message_bytes + pieces * (kPieceOverheadBytes + kIpUdpBytes);
}

double payload_share(std::size_t message_bytes) {
  return static_cast<double>(message_bytes) / static_cast<double>(ip_bytes_of(message_bytes));
}

std::vector<Scenario> scenarios(std::string_view group, const Choice& choice) {
  std::vector<Scenario> family;
  if (group == "rate") family = rate(choice);
  if (group == "size") family = size(choice);
  if (group == "dip") family = dip(choice);
  std::vector<Peer> peers = choice.peers;
  if (peers.empty()) {
    for (std::size_t i = 0; i < kPeers; ++i) peers.push_back(static_cast<Peer>(i));
  }
  std::vector<Scenario> out;
  for (const Peer peer : peers) {
    for (Scenario s : family) {
      s.peer = peer;
      if (s.small_bytes == 0) s.small_bytes = s.message_bytes / kSmaller;
      out.push_back(std::move(s));
    }
  }
  return out;
}

}  // namespace interneuron::load
