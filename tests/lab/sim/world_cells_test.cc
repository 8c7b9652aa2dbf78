// Hosts that share bottlenecks and NICs, and hosts that are no endpoints.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim::world_cells_test {
namespace {

constexpr LinkId kLink{0};

// Sends packets of a size at a pace from `from` on, and remembers what arrives.
class Talker : public ForeignHost {
 public:
  struct Plan {
    Address to{};
    std::size_t ip_bytes = 0;
    Duration gap{};
    int count = 0;
    Ecn ecn = Ecn::kNotEct;
  };
  explicit Talker(Plan plan) : plan_(plan) {}

  void handle_packet(Duration now, const ForeignPacket& packet) override {
    arrived.emplace_back(now, packet);
  }
  void handle_timeout(Duration) override {}
  std::optional<ForeignPacket> poll_transmit(Duration now) override {
    if (sent_ == plan_.count || now < next_) return std::nullopt;
    next_ += plan_.gap;
    ++sent_;
    return ForeignPacket{
        kLink, plan_.to, plan_.ip_bytes, plan_.ecn, {static_cast<std::byte>(sent_)}};
  }
  std::optional<Duration> next_timeout(Duration) const override {
    if (sent_ == plan_.count) return std::nullopt;
    return next_;
  }

  std::vector<std::pair<Duration, ForeignPacket>> arrived;

 private:
  Plan plan_;
  Duration next_ = 1ms;
  int sent_ = 0;
};

// A link that adds 20 ms each way and is far quicker than any cell below.
emu::Link access() { return emu::Link(constant_link("access", 40, 10'000, 10'000), 1); }

// 8 Mbit/s: 1000 bytes a millisecond.
emu::CellParams slow_cell(std::size_t queue_bytes = 1'000'000) {
  return emu::CellParams{.rate = DataRate::mbit(8), .queue_bytes = queue_bytes};
}

// Two talkers that send to a third.
struct Three {
  World world{1};
  HostId sink = 0;
  std::vector<WireId> wires;
  Talker* sunk = nullptr;

  explicit Three(Talker::Plan plan) {
    auto listener = std::make_unique<Talker>(Talker::Plan{});
    sunk = listener.get();
    sink = world.add_foreign(std::move(listener));
    plan.to = World::address_of(sink, kLink);
    for (int i = 0; i < 2; ++i) {
      const HostId from = world.add_foreign(std::make_unique<Talker>(plan));
      wires.push_back(world.add_link(from, sink, kLink, "l", access()));
    }
  }
};

TEST(WorldCells, ForeignHostsTalkOverALink) {
  Three three({.ip_bytes = 1000, .gap = 10ms, .count = 3, .ecn = Ecn::kEct0});
  three.world.run_until(1s);
  ASSERT_EQ(three.sunk->arrived.size(), 6U);
  const auto& [at, packet] = three.sunk->arrived[0];
  EXPECT_NEAR(to_ms(at), 21, 0.01);
  EXPECT_EQ(packet.peer, World::address_of(1, kLink));
  EXPECT_EQ(packet.ip_bytes, 1000U);
  EXPECT_EQ(packet.ecn, Ecn::kEct0);
  EXPECT_EQ(packet.bytes, Bytes{std::byte{1}});
}

TEST(WorldCells, LinksMayHaveAnyNumber) {
  World world(1);
  const HostId a = world.add_foreign(std::make_unique<Talker>(Talker::Plan{}));
  const HostId b = world.add_foreign(std::make_unique<Talker>(Talker::Plan{}));
  const HostId c = world.add_foreign(std::make_unique<Talker>(Talker::Plan{}));
  const WireId first = world.add_link(b, c, LinkId{0}, "l", access());
  const WireId second = world.add_link(a, c, LinkId{256}, "l", access());
  EXPECT_NE(first, second);
  EXPECT_NE(World::address_of(c, LinkId{0}), World::address_of(c, LinkId{256}));
}

TEST(WorldCells, LinksShareACell) {
  // Twice 1000 bytes each 1.25 ms: 160 % of the cell.
  Three three({.ip_bytes = 1000, .gap = 1250us, .count = 4000});
  const CellId cell = three.world.add_cell(slow_cell(30'000));
  for (const WireId wire : three.wires) three.world.pass_through(wire, true, cell);
  three.world.run_until(1s);
  three.world.measure_cells();
  three.world.run_until(5s);
  const emu::Cell& model = three.world.cell(cell);
  EXPECT_NEAR(model.utilisation(5s), 1, 0.001);
  EXPECT_NEAR(to_ms(model.queue_time().quantile(0.5)), 30, 1.5);
  three.world.run_until(6s);
  std::uint64_t arrived = 0;
  for (const WireId wire : three.wires) arrived += model.stats(wire.value).delivered;
  EXPECT_EQ(arrived, three.sunk->arrived.size());
  EXPECT_EQ(arrived + model.stats().queue_drops, 8000U);
}

TEST(WorldCells, PacketsPassTheirCellsInOrderBehindTheLink) {
  Three three({.ip_bytes = 1000, .gap = 1s, .count = 1});
  const CellId first = three.world.add_cell(slow_cell());
  const CellId second = three.world.add_cell(slow_cell());
  for (const CellId cell : {second, first}) three.world.pass_through(three.wires[0], true, cell);
  three.world.run_until(1s);
  ASSERT_EQ(three.sunk->arrived.size(), 2U);
  // 20 ms on the link, and for the first talker 1 ms in each cell.
  EXPECT_NEAR(to_ms(three.sunk->arrived[0].first), 21, 0.01);
  EXPECT_NEAR(to_ms(three.sunk->arrived[1].first), 23, 0.01);
  EXPECT_EQ(three.world.cell(first).stats(0).delivered, 1U);
  EXPECT_EQ(three.world.cell(second).stats(1).packets_in, 0U);
}

TEST(WorldCells, CellsMarkPackets) {
  Three three({.ip_bytes = 1000, .gap = 100us, .count = 20, .ecn = Ecn::kEct1});
  emu::CellParams params = slow_cell();
  params.mark_above = 1ms;
  const CellId cell = three.world.add_cell(params);
  for (const WireId wire : three.wires) three.world.pass_through(wire, true, cell);
  three.world.run_until(1s);
  const auto marked = std::ranges::count_if(three.sunk->arrived,
                                            [](const auto& a) { return a.second.ecn == Ecn::kCe; });
  EXPECT_EQ(three.sunk->arrived.size(), 40U);
  EXPECT_EQ(static_cast<std::uint64_t>(marked), three.world.cell(cell).stats().marked);
  EXPECT_GT(marked, 30);
}

TEST(WorldCells, NicsAndHopsHaveAnMtuEach) {
  Three three({.ip_bytes = 1400, .gap = 10ms, .count = 5});
  three.world.add_nic(1, kLink, {"small", 1399});
  emu::CellParams params = slow_cell();
  params.mtu = 1380;
  const CellId cell = three.world.add_cell(params);
  three.world.pass_through(three.wires[1], true, cell);
  three.world.run_until(1s);
  EXPECT_TRUE(three.sunk->arrived.empty());
  EXPECT_EQ(three.world.above_nic_mtu(), 5U);
  EXPECT_EQ(three.world.cell(cell).stats().too_big, 5U);
}

EndpointOptions endpoint(std::uint32_t session, bool road) {
  EndpointOptions o;
  o.session = SessionId{session};
  o.policies = builtin_policies();
  o.accept_peers = road;
  if (road) return o;
  PipelineConfig pipeline{.stages = {StageKind::kCommunication, StageKind::kCommunication}};
  o.pipelines = {pipeline};
  return o;
}

// A roadside unit has one NIC, by which it knows all its vehicles.
TEST(WorldCells, VehiclesMeetBehindOneNic) {
  constexpr std::size_t kVehicles = 20;
  World world(1);
  const HostId road = world.add_host(endpoint(1000, true));
  emu::CellParams params = slow_cell();
  params.rate = DataRate::mbit(200);
  const CellId cell = world.add_cell(params);
  std::vector<PeerId> peers;
  for (std::uint32_t i = 0; i < kVehicles; ++i) {
    const HostId vehicle = world.add_host(endpoint(i + 1, false));
    const WireId wire = world.add_link(vehicle, road, kLink, "v2i", access());
    world.pass_through(wire, true, cell);
    world.pass_through(wire, false, cell);
    peers.push_back(world.connect(vehicle, road));
  }
  std::size_t answered = 0;
  world.on_event([&](HostId host, Event&& event) {
    if (const auto* got = std::get_if<Delivered>(&event)) {
      world.endpoint(host).submit(world.local_time(host), got->round, {Bytes(100)},
                                  MessageClass::kResult);
    } else if (const auto* done = std::get_if<RoundDone>(&event)) {
      answered += done->outcome == Outcome::kRemote ? 1 : 0;
    }
  });
  world.run_until(2s);
  EXPECT_EQ(world.endpoint(road).peers().size(), kVehicles);
  for (std::size_t i = 0; i < kVehicles; ++i) {
    const HostId vehicle = road + 1 + i;
    Endpoint& e = world.endpoint(vehicle);
    const RoundRef round = e.begin_round(world.local_time(vehicle), PipelineId{0});
    e.submit(world.local_time(vehicle), round, {Bytes(1000)}, MessageClass::kData, peers[i]);
    world.flush(vehicle);
  }
  world.run_until(3s);
  EXPECT_EQ(answered, kVehicles);
}

TEST(WorldCells, AddressesOfManyHostsDiffer) {
  EXPECT_NE(World::address_of(1, kLink), World::address_of(257, kLink));
  EXPECT_NE(World::address_of(1, kLink), World::address_of(65'537, kLink));
}

TEST(WorldCells, MistakesAreRefused) {
  Three three({});
  EXPECT_THROW(three.world.add_link(1, three.sink, kLink, "l", access()), std::invalid_argument);
  EXPECT_THROW(three.world.add_link(1, 99, LinkId{1}, "l", access()), std::invalid_argument);
  EXPECT_THROW(three.world.pass_through(three.wires[0], true, CellId{0}), std::invalid_argument);
  EXPECT_THROW(three.world.faults(WireId{9}), std::invalid_argument);
  EXPECT_THROW(three.world.wire_of(LinkId{7}), std::invalid_argument);
}

}  // namespace
}  // namespace interneuron::sim::world_cells_test
