#include "lab/transports/play.h"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cerrno>
#include <charconv>
#include <optional>

#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "app/process/signals.h"
#include "lab/transports/ends.h"
#include "lab/transports/programs.h"
#include "netns/testbed/testbed.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

namespace fs = std::filesystem;
using netns::Testbed;

// An emulator that is later than this on average spoils the figures: a packet of 1500 bytes takes
// 0.6 ms at 20 Mbit/s.
constexpr double kLateUs = 500;

// Runs a tool in a host; throws Failure when it fails.
void in_host(const netns::State& state, netns::Host host, const std::vector<std::string>& argv) {
  if (Testbed::run_in(state, host, argv) == 0) return;
  throw process::Failure(process::kFailed,
                         fmt::format("`{}` failed; this transport needs it", fmt::join(argv, " ")));
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

// Each address of the roadside unit is reached over a modem of its own, for programs that name
// neither a source address nor a NIC: else all that they send would leave by the first one.
void route_by_destination(const netns::State& state) {
  for (const netns::TestbedLink& link : state.links) {
    in_host(state, netns::kVehicle,
            {"ip", "route", "add", link.road_address, "via", link.gateway, "dev", link.nic});
  }
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
    throw process::Failure(process::kFailed,
                           "the vehicles of a run said '" + said + "' where an instant belongs");
  }
  return TimePoint{Duration{ns}};
}

bool has_control(const std::string& name) {
  const io::FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const auto size = static_cast<socklen_t>(name.size());
  // EPERM: the kernel has it, and root in a host of the testbed may use it.
  return ::setsockopt(socket.get(), IPPROTO_TCP, TCP_CONGESTION, name.data(), size) == 0 ||
         errno == EPERM;
}

// Interneuron is compared as it is used: encrypted.
Order with_keys(Order order) {
  if (order.transport.kind != Kind::kOurs) return order;
  const std::size_t ends = 1 + order.traffic.vehicles();
  for (std::size_t i = order.keys.size(); i < ends; ++i) order.keys.push_back(random_key());
  return order;
}

}  // namespace

std::optional<std::string> lacks(const Transport& transport) {
  if (transport.kind == Kind::kFastDds) return lacks_fastdds();
  if (transport.kind == Kind::kSrt) return lacks_srt();
  const bool is_tcp = transport.kind == Kind::kTcp || transport.kind == Kind::kMptcp;
  if (is_tcp && !has_control(transport.mode)) {
    return "this kernel has no congestion control '" + transport.mode +
           "' (net.ipv4.tcp_available_congestion_control)";
  }
  if (transport.kind != Kind::kMptcp) return std::nullopt;
  const io::FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, IPPROTO_MPTCP));
  if (socket.get() >= 0) return std::nullopt;
  return "this kernel has no MPTCP (net.mptcp.enabled)";
}

std::vector<Modem> modems_of(const netns::State& state) {
  std::vector<Modem> out;
  for (const netns::TestbedLink& link : state.links) {
    if (link.vehicle == 0) out.push_back({link.nic, link.vehicle_address, link.road_address});
  }
  return out;
}

Played play(const netns::State& state, const Order& given, const Meanwhile& meanwhile) {
  const Order order = with_keys(given);
  if (order.transport.kind == Kind::kMptcp) allow_subflows(state);
  if (order.transport.kind == Kind::kFastDds) route_by_destination(state);
  const fs::path file = write_order(order);
  std::optional<EndProgram> cross;
  std::optional<EndProgram> cross_road;
  if (!order.cross.empty()) {
    cross_road.emplace(state, netns::kRoad, file, kCrossRoadEnd);
    cross_road->await_ready();
  }
  EndProgram road(state, netns::kRoad, file, kRoadEnd);
  road.await_ready();
  EndProgram vehicles(state, netns::kVehicle, file, kVehiclesEnd);
  Played out;
  out.begin = instant_of(vehicles.await_ready());

  if (cross_road) {
    process::SignalWatch::sleep(out.begin - order.cross_lead - io::now());
    cross.emplace(state, netns::kVehicle, file, kCrossEnd);
  }
  process::SignalWatch::sleep(out.begin - io::now());
  const netns::Snapshot before = Testbed::snapshot(state);
  if (meanwhile) meanwhile(out.begin);
  process::SignalWatch::sleep(out.begin + order.traffic.length - io::now());
  out.after = Testbed::snapshot(state);
  vehicles.finish();
  road.end();
  if (cross_road) {
    cross->end();
    cross_road->end();
    out.cross = read_cross(order);
  }
  out.doubt = doubt_of(before, out.after);
  out.vehicles = read_vehicles(order);
  out.road = read_road(order);
  return out;
}

Scratch::Scratch(fs::path folder) : folder_(std::move(folder)) {
  process::make_private_folder(folder_);
}

Scratch::~Scratch() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace interneuron::transports
