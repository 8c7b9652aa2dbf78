// One run of `bench load --testbed` as its two programs are told of it, and what they leave. The
// command writes the order to a file and starts itself once more in each host of the testbed with
// --order FILE; each of these programs leaves its record beside that file.
//
// All instants are of CLOCK_MONOTONIC, which both programs read on one machine. Plain values.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "interneuron/time.h"
#include "lab/load/scenario.h"

namespace interneuron::cli {

// How a vehicle reaches the roadside unit: numeric addresses, and the NIC of both.
struct Modem {
  std::string nic;
  std::string vehicle_address;
  std::string road_address;
};

struct Order {
  // What the programs need of it: the peer, the vehicles and their messages.
  load::Scenario scenario;
  std::vector<Modem> modems;
  // The folder of the order's file, where records go.
  std::filesystem::path folder;
};

// Where the roadside unit waits for messages.
inline constexpr std::uint16_t kLoadPort = 47000;

// Of the program that plays the vehicles: when each message was handed over, by vehicle and number.
struct VehiclesRecord {
  std::vector<std::vector<TimePoint>> begun;
};

struct Arrival {
  std::uint32_t vehicle = 0;
  std::uint32_t number = 0;
  std::uint32_t variant = 0;
  TimePoint at{};
};

// Of the roadside unit.
struct RoadRecord {
  // In the order of arrival.
  std::vector<Arrival> arrivals;
  // Processor time over time, from the first arrival to the last one; 0 with fewer than two.
  double cpu = 0;
};

// They throw Failure (1) that names the file when it cannot be written or read, or is none.
std::filesystem::path write_order(const Order& order);
Order read_order(const std::filesystem::path& file);
void write_record(const Order& order, const VehiclesRecord& record);
void write_record(const Order& order, const RoadRecord& record);
VehiclesRecord read_vehicles(const Order& order);
RoadRecord read_road(const Order& order);

}  // namespace interneuron::cli
