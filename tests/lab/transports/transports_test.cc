// What the programs of a run are told and leave, and what they note.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "app/process/failure.h"
#include "lab/transports/ends.h"
#include "lab/transports/message_head.h"
#include "lab/transports/order.h"
#include "lab/transports/outlay.h"
#include "lab/transports/pieces.h"
#include "lab/transports/play.h"
#include "lab/transports/timetable.h"

namespace interneuron::transports::transports_test {
namespace {

using namespace std::chrono_literals;

// A folder for the files of a test, private to it.
std::filesystem::path folder_of(const std::string& name) {
  return std::filesystem::temp_directory_path() /
         ("interneuron-" + name + "-" + std::to_string(::getpid()));
}

Order order_in(const std::filesystem::path& folder) {
  return {{Kind::kMptcp, "cubic"},
          {{48 * 1024, 12 * 1024}, 150ms, 100ms, 350ms, {0ms, 70ms}},
          {{"ifa", "10.77.1.2", "10.77.0.1"}, {"ifb", "10.78.1.2", "10.78.0.1"}},
          folder,
          15ms};
}

TEST(Transports, OrdersAreReadAsTheyWereWritten) {
  const auto folder = folder_of("orders");
  const Scratch scratch(folder);
  Order written = order_in(folder);
  for (int i = 0; i < 3; ++i) written.keys.push_back(random_key());
  written.traffic.joins = {0ms, 30ms};
  written.cross = {{"bbr", {"ifx", "10.79.1.2", "10.79.0.1"}}};
  written.cross_lead = 1s;
  const Order read = read_order(write_order(written));
  EXPECT_EQ(read.transport, written.transport);
  EXPECT_EQ(read.traffic.variant_bytes, written.traffic.variant_bytes);
  EXPECT_EQ(read.traffic.deadline, 150ms);
  EXPECT_EQ(read.traffic.period, 100ms);
  EXPECT_EQ(read.traffic.length, 350ms);
  EXPECT_EQ(read.traffic.first, written.traffic.first);
  EXPECT_EQ(read.traffic.joins, written.traffic.joins);
  ASSERT_EQ(read.cross.size(), 1U);
  EXPECT_EQ(read.cross[0].control, "bbr");
  EXPECT_EQ(read.cross[0].modem.road_address, "10.79.0.1");
  EXPECT_EQ(read.cross_lead, 1s);
  EXPECT_EQ(read.folder, folder);
  EXPECT_EQ(read.way, 15ms);
  EXPECT_EQ(read.keys, written.keys);
  ASSERT_EQ(read.modems.size(), 2U);
  EXPECT_EQ(read.modems[1].nic, "ifb");
  EXPECT_EQ(read.modems[1].vehicle_address, "10.78.1.2");
}

TEST(Transports, CrossTrafficIsCountedBetweenTwoInstants) {
  const CrossRecord record{
      {{TimePoint{10ms}, 100}, {TimePoint{20ms}, 300}, {TimePoint{30ms}, 600}}};
  EXPECT_EQ(record.bytes_between(TimePoint{0ms}, TimePoint{40ms}), 600U);
  EXPECT_EQ(record.bytes_between(TimePoint{10ms}, TimePoint{29ms}), 200U);
  EXPECT_EQ(CrossRecord{}.bytes_between(TimePoint{0ms}, TimePoint{40ms}), 0U);
}

TEST(Transports, AnOrderThatMakesNoSenseIsRefused) {
  const auto folder = folder_of("nonsense");
  const Scratch scratch(folder);
  EXPECT_THROW(read_order(folder / "order.json"), process::Failure);
  std::ofstream(folder / "order.json") << R"({"transport": "pigeon", "mode": ""})";
  EXPECT_THROW(read_order(folder / "order.json"), process::Failure);
  Order order = order_in(folder);
  order.keys.emplace_back();
  const auto file = write_order(order);
  std::ifstream in(file);
  std::string text(std::istreambuf_iterator<char>(in), {});
  text.replace(text.find("AAAA"), 4, "====");
  std::ofstream(file) << text;
  EXPECT_THROW(read_order(file), process::Failure);
}

TEST(Transports, RecordsAreReadAsTheyWereWritten) {
  const auto folder = folder_of("records");
  const Scratch scratch(folder);
  const Order order = order_in(folder);
  write_record(order,
               VehiclesRecord{{{TimePoint{1s}, TimePoint{2s}}, {TimePoint{3s}}}, 70ms, 1'000'000});
  write_record(order, RoadRecord{{{1, 0, 1, TimePoint{4s}}}, 0.25});
  const VehiclesRecord vehicles = read_vehicles(order);
  ASSERT_EQ(vehicles.begun.size(), 2U);
  EXPECT_EQ(vehicles.begun[0][1], TimePoint{2s});
  EXPECT_EQ(vehicles.cpu, 70ms);
  EXPECT_EQ(vehicles.wire_bytes, 1'000'000U);
  const RoadRecord road = read_road(order);
  ASSERT_EQ(road.arrivals.size(), 1U);
  EXPECT_EQ(road.arrivals[0].vehicle, 1U);
  EXPECT_EQ(road.arrivals[0].variant, 1U);
  EXPECT_EQ(road.arrivals[0].at, TimePoint{4s});
  EXPECT_EQ(road.cpu, 0.25);
}

TEST(Transports, AMessageTellsWhichItIs) {
  const Bytes message = message_of(200, 70'000, 48 * 1024);
  EXPECT_EQ(message.size(), 48U * 1024);
  const auto head = read_head(message);
  ASSERT_TRUE(head);
  EXPECT_EQ(head->vehicle, 200U);
  EXPECT_EQ(head->number, 70'000U);
  EXPECT_EQ(head->bytes, 48U * 1024);
  EXPECT_FALSE(read_head(ByteView(message).first(kMessageHeadBytes - 1)));
}

TEST(Transports, APieceHasItsPlaceAndItsShareOfTheMessage) {
  Pieces pieces({1, 7, 2000}, 1000);
  ASSERT_EQ(pieces.count(), 3U);
  EXPECT_EQ(pieces.piece(0).size(), 1000U);
  EXPECT_EQ(pieces.piece(1).size(), 1000U);
  EXPECT_EQ(pieces.piece(2).size(), 2000 - 2 * (1000 - kPieceHeadBytes) + kPieceHeadBytes);
  EXPECT_EQ(read_head(pieces.piece(2))->number, 7U);
}

TEST(Transports, AMessageIsWholeWhenEachOfItsPiecesHasCome) {
  Pieces pieces({0, 7, 2000}, 1000);
  Assembly assembly;
  EXPECT_FALSE(assembly.take(pieces.piece(2)));
  EXPECT_FALSE(assembly.take(pieces.piece(2)));
  EXPECT_FALSE(assembly.take(pieces.piece(0)));
  const auto whole = assembly.take(pieces.piece(1));
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->number, 7U);
  EXPECT_EQ(whole->bytes, 2000U);
  // Copies of it by another way are no message again.
  for (const std::uint32_t place : {0U, 1U, 2U}) EXPECT_FALSE(assembly.take(pieces.piece(place)));
}

TEST(Transports, APieceThatMakesNoSenseIsDropped) {
  Pieces pieces({0, 7, 2000}, 1000);
  Assembly assembly;
  EXPECT_FALSE(assembly.take(pieces.piece(0).first(kPieceHeadBytes - 1)));
  // The seventh of three.
  EXPECT_FALSE(assembly.take(pieces.piece(0)));
  Bytes odd(pieces.piece(1).begin(), pieces.piece(1).end());
  head_detail::put(odd.data() + kMessageHeadBytes, 6U << 16U | 3U);
  EXPECT_FALSE(assembly.take(odd));
}

TEST(Transports, ATimetableHasTheMessagesOfAllVehiclesInOrder) {
  const std::vector<Due> due = timetable(order_in({}).traffic);
  ASSERT_EQ(due.size(), 7U);
  EXPECT_EQ(due[0].at, 0ms);
  EXPECT_EQ(due[1].at, 70ms);
  EXPECT_EQ(due[1].vehicle, 1U);
  EXPECT_EQ(due.back().at, 300ms);
  EXPECT_EQ(due.back().vehicle, 0U);
}

TEST(Transports, AReceptionTellsTheShareOfAProcessor) {
  Reception reception;
  EXPECT_EQ(reception.cpu(), 0);
  reception.arrived({0, 0, 100}, 0, TimePoint{1s});
  EXPECT_EQ(reception.cpu(), 0);
  const Duration before = processor_time();
  while (processor_time() - before < 5ms) continue;
  reception.arrived({0, 1, 100}, 0, TimePoint{2s});
  EXPECT_GE(reception.cpu(), 0.004);
}

TEST(Transports, AnOutlayCountsOnlyWhatIsSpentSince) {
  const Duration before = processor_time();
  while (processor_time() - before < 5ms) continue;
  const Outlay outlay;
  const Duration at_first = outlay.cpu();
  EXPECT_LT(at_first, 5ms);
  while (processor_time() - before < 15ms) continue;
  EXPECT_GE(outlay.cpu(), at_first + 4ms);
}

TEST(Transports, LacksNamesAControlThatThereIsNot) {
  EXPECT_TRUE(lacks({Kind::kTcp, "nonesuch"}));
  EXPECT_FALSE(lacks({Kind::kUdp, ""}));
  EXPECT_FALSE(lacks({Kind::kOurs, "best_link"}));
}

}  // namespace
}  // namespace interneuron::transports::transports_test
