#include "app/load_testbed/run.h"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <string_view>

#include "app/load_testbed/order.h"
#include "app/load_testbed/programs.h"
#include "host/io/steady_clock.h"
#include "host/process/failure.h"
#include "host/process/signals.h"
#include "lab/load/bottleneck.h"
#include "netns/testbed/testbed.h"

namespace interneuron::cli {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using load::Peer;
using load::Scenario;
using netns::Testbed;

constexpr const char* kCell = "cell";
constexpr const char* kModems[] = {"a", "b"};
// What a run takes beside its messages: the testbed, the programs, their meeting.
constexpr Duration kOverhead = 4s;
// An emulator that is later than this on average spoils the figures: a packet of 1500 bytes takes
// 0.6 ms at 20 Mbit/s.
constexpr double kLateUs = 500;

// --- the testbed of a scenario

netns::TestbedOptions options_of(const Scenario& s, const fs::path& scratch) {
  netns::TestbedOptions out;
  out.name = fmt::format("load-{}", ::getpid());
  out.backend = netns::Backend::kEmulator;
  out.runtime_dir = scratch;
  const emu::LinkProfile modem = load::modem_of(s);
  emu::ScenarioCell cell;
  cell.name = kCell;
  cell.up = load::cell_of(s, {});
  // The way back is never short.
  cell.down.rate = modem.down.rate;
  cell.down.queue_bytes = modem.down.queue_bytes;
  std::vector<emu::ScenarioLink> links;
  for (std::size_t i = 0; i < (s.peer == Peer::kMptcp ? 2U : 1U); ++i) {
    links.push_back({kModems[i], modem, emu::link_seed(s.seed, i), 0});
  }
  out.scenario = emu::plain_scenario(std::move(links), s.seed);
  out.scenario.cells = {std::move(cell)};
  return out;
}

Order order_of(const Scenario& s, const netns::State& state, const fs::path& scratch) {
  Order order{s, {}, scratch};
  for (const netns::TestbedLink& link : state.links) {
    order.modems.push_back({link.nic, link.vehicle_address, link.road_address});
  }
  return order;
}

// Runs a tool in a host; throws Failure when it fails.
void in_host(const netns::State& state, netns::Host host, const std::vector<std::string>& argv) {
  if (Testbed::run_in(state, host, argv) == 0) return;
  throw Failure(kFailed, fmt::format("`{}` failed; MPTCP needs it", fmt::join(argv, " ")));
}

// The kernel's path manager opens a subflow from the second modem, too.
void allow_subflows(const netns::State& state) {
  for (const netns::Host host : {netns::kVehicle, netns::kRoad}) {
    in_host(state, host,
            {"ip", "mptcp", "limits", "set", "subflows", "1", "add_addr_accepted", "1"});
  }
  const netns::TestbedLink& second = state.links.at(1);
  in_host(state, netns::kVehicle,
          {"ip", "mptcp", "endpoint", "add", second.vehicle_address, "dev", second.nic, "subflow"});
}

// --- figures

load::Meter meter_of(const Scenario& s, const VehiclesRecord& vehicles, const RoadRecord& road) {
  const std::vector<std::size_t> variants = load::variant_bytes(s);
  load::Meter meter(s.vehicles, s.deadline, variants);
  for (std::size_t v = 0; v < std::min(s.vehicles, vehicles.begun.size()); ++v) {
    for (const TimePoint at : vehicles.begun[v]) meter.begin(v, at.time_since_epoch());
  }
  for (const Arrival& a : road.arrivals) {
    if (a.vehicle >= s.vehicles || a.variant >= variants.size()) continue;
    if (a.number >= meter.messages(a.vehicle).size()) continue;
    meter.arrived(a.vehicle, a.number, a.variant, a.at.time_since_epoch());
  }
  return meter;
}

std::string doubt_of(const netns::Snapshot& before, const netns::Snapshot& after) {
  if (after.kernel_drops > before.kernel_drops) {
    return fmt::format("the emulator lost {} packets of its own",
                       after.kernel_drops - before.kernel_drops);
  }
  if (after.lateness_mean_us > kLateUs) {
    return fmt::format("the emulator ran {:.1f} ms late on average", after.lateness_mean_us / 1e3);
  }
  return "";
}

TimePoint instant_of(const std::string& said) {
  std::int64_t ns = 0;
  const auto [end, error] = std::from_chars(said.data(), said.data() + said.size(), ns);
  if (error != std::errc{} || end != said.data() + said.size()) {
    throw Failure(kFailed, "the vehicles of a run said '" + said + "' where an instant belongs");
  }
  return TimePoint{Duration{ns}};
}

// Removes a folder at the end, whatever that is.
class Scratch {
 public:
  explicit Scratch(fs::path folder) : folder_(std::move(folder)) {
    fs::create_directories(folder_);
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

 private:
  fs::path folder_;
};

bool has_control(const char* name) {
  const io::FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const auto size = static_cast<socklen_t>(std::string_view(name).size());
  // EPERM: the kernel has it, and root in a host of the testbed may use it.
  return ::setsockopt(socket.get(), IPPROTO_TCP, TCP_CONGESTION, name, size) == 0 || errno == EPERM;
}

}  // namespace

std::optional<std::string> lacks(Peer peer) {
  const std::string name(load::name_of(peer));
  if (peer == Peer::kTcpBbr && !has_control("bbr")) {
    return name + ": this kernel has no BBR (net.ipv4.tcp_available_congestion_control)";
  }
  if (peer == Peer::kTcpCubic && !has_control("cubic")) {
    return name + ": this kernel has no CUBIC (net.ipv4.tcp_available_congestion_control)";
  }
  if (peer != Peer::kMptcp) return std::nullopt;
  const io::FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, IPPROTO_MPTCP));
  if (socket.get() >= 0) return std::nullopt;
  return name + ": this kernel has no MPTCP (net.mptcp.enabled)";
}

std::optional<std::string> cannot_play(const Scenario& s) {
  if (s.dip) return s.group + ": a rate that changes during a run is for virtual time alone";
  if (s.cross_flows > 0) return s.group + ": cross traffic is for virtual time alone";
  return std::nullopt;
}

Duration time_of_run(const Scenario& s) { return s.length + s.deadline + kOverhead; }

TestbedRow run_on_testbed(const Scenario& s, const fs::path& folder) {
  const Scratch scratch(folder);
  const Testbed testbed = Testbed::up(options_of(s, folder));
  if (s.peer == Peer::kMptcp) allow_subflows(testbed.state());
  const Order order = order_of(s, testbed.state(), folder);
  const fs::path file = write_order(order);
  LoadProgram road(testbed.state(), netns::kRoad, file, kRoadEnd);
  road.await_ready();
  LoadProgram vehicles(testbed.state(), netns::kVehicle, file, kVehiclesEnd);
  const TimePoint begin = instant_of(vehicles.await_ready());

  SignalWatch::sleep(begin - io::now());
  Testbed::measure_cells(testbed.state());
  const netns::Snapshot before = testbed.snapshot();
  SignalWatch::sleep(begin + s.length - io::now());
  const netns::Snapshot after = testbed.snapshot();
  vehicles.finish();
  road.end();

  TestbedRow out{{}, doubt_of(before, after)};
  const RoadRecord record = read_road(order);
  const load::Meter meter = meter_of(s, read_vehicles(order), record);
  out.row.scenario = s;
  load::read_messages(s, meter, begin.time_since_epoch(), out.row);
  out.row.queue_p99_ms = to_ms(after.cells.at(0).up.queue_p99);
  out.row.utilisation = after.cells.at(0).up.utilisation;
  out.row.road_cpu_percent = 100 * record.cpu;
  return out;
}

}  // namespace interneuron::cli
