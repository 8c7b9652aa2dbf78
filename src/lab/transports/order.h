// One run of two programs that carry messages over a transport: what they are told of it, and what
// they leave. Whoever makes the run writes the order to a file and starts this program once more in
// each host of a testbed (programs.h); each of the two leaves its record beside that file.
//
// All instants are of CLOCK_MONOTONIC, which both programs read on one machine. Plain values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/node_options.h"
#include "interneuron/security.h"
#include "interneuron/time.h"

namespace interneuron::transports {

// What carries the messages: kTcp and kMptcp are the kernel's.
enum class Kind : std::uint8_t { kOurs, kUdp, kTcp, kMptcp, kFastDds, kSrt };
// "ours", "udp", "tcp", "mptcp", "fastdds", "srt".
std::string_view name_of(Kind kind);

struct Transport {
  Kind kind{};
  // How it does that, which is another thing for each kind: the name of a policy of Interneuron, of
  // a congestion control of TCP and MPTCP, "stock" or "tuned" Fast DDS, the kind of a group of SRT.
  // Empty for UDP.
  std::string mode;
  // What the datagrams of our own nodes pass through, at both ends; the others have their own ways.
  TransportKind datagrams = TransportKind::kUdp;
  friend bool operator==(const Transport&, const Transport&) = default;
};

// The messages of a run.
struct Traffic {
  // Sizes of the variants of a message, from the whole one on; at least one. A transport that knows
  // no variants sends the first.
  std::vector<std::size_t> variant_bytes;
  // From the instant at which a message is handed over.
  Duration deadline{};
  // Between two messages of a vehicle.
  Duration period{};
  // Messages begin for this long.
  Duration length{};
  // When each vehicle hands over its first message, since messages begin; there are as many
  // vehicles.
  std::vector<Duration> first;
  // When each vehicle begins to talk to the roadside unit, since the first one does; those that are
  // not named do so at once. Transports that have connections open them at once.
  std::vector<Duration> joins = {};

  std::size_t vehicles() const { return first.size(); }
};

// How a vehicle reaches the roadside unit: numeric addresses, and the NIC of both.
struct Modem {
  std::string nic;
  std::string vehicle_address;
  std::string road_address;
};

// TCP with unlimited demand beside the messages, by the kernel's congestion control of this name.
struct CrossFlow {
  std::string control;
  Modem modem;
};

struct Order {
  Transport transport;
  Traffic traffic;
  // Those that the transport may use; at least one.
  std::vector<Modem> modems;
  // The folder of the order's file, where records go.
  std::filesystem::path folder;
  // How long one way takes over the first modem without any queue, about; for transports that have
  // to be told how long to hold packets back.
  Duration way{};
  // The private keys of Interneuron's ends, made for one run: the roadside unit's, then one for
  // each vehicle. Without them the ends talk in the clear.
  std::vector<SecretKey> keys = {};
  // They begin so long before the messages.
  std::vector<CrossFlow> cross = {};
  Duration cross_lead{};
};

// Where the roadside unit waits for messages.
inline constexpr std::uint16_t kLoadPort = 47000;
// And for cross traffic.
inline constexpr std::uint16_t kCrossPort = 47001;

// What the program that plays the vehicles leaves.
struct VehiclesRecord {
  // When each message was handed over, by vehicle and number.
  std::vector<std::vector<TimePoint>> begun;
  // While messages began, and a deadline longer (outlay.h).
  Duration cpu{};
  std::uint64_t wire_bytes = 0;
};

struct Arrival {
  std::uint32_t vehicle = 0;
  std::uint32_t number = 0;
  std::uint32_t variant = 0;
  TimePoint at{};
};

// What the program that plays the roadside unit leaves.
struct RoadRecord {
  // In the order of arrival.
  std::vector<Arrival> arrivals;
  // Processor time over time, from the first arrival to the last one; 0 with fewer than two.
  double cpu = 0;
};

// What the program that takes the cross traffic leaves: the bytes that an application could read by
// then, of all flows; some hundred times a second.
struct CrossRecord {
  struct Sample {
    TimePoint at{};
    std::uint64_t bytes = 0;
  };
  std::vector<Sample> samples;

  std::uint64_t bytes_between(TimePoint from, TimePoint to) const;
};

// They throw Failure (1) that names the file when it cannot be written or read, or is none. Nobody
// else may enter the order's folder: the file holds its keys.
std::filesystem::path write_order(const Order& order);
Order read_order(const std::filesystem::path& file);
void write_record(const Order& order, const VehiclesRecord& record);
void write_record(const Order& order, const RoadRecord& record);
void write_record(const Order& order, const CrossRecord& record);
VehiclesRecord read_vehicles(const Order& order);
RoadRecord read_road(const Order& order);
CrossRecord read_cross(const Order& order);

}  // namespace interneuron::transports
