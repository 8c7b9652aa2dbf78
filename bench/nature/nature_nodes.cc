#include "bench/nature/nature_nodes.h"

#include <fmt/os.h>
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <fstream>
#include <functional>
#include <optional>
#include <utility>

#include "app/process/failure.h"
#include "app/settings/peer_address.h"
#include "app/settings/program.h"
#include "interneuron/node.h"
#include "netns/state/hosts.h"
#include "netns/testbed/testbed.h"

namespace interneuron::bench {
namespace {

constexpr PipelineId kPipeline{0};
constexpr Duration kPeriod = std::chrono::milliseconds(100);
// Longer than every round trip of the steps, so that messages are never dropped as too late.
constexpr Duration kDeadline = std::chrono::milliseconds(400);
// How often the vehicle writes its estimates.
constexpr Duration kSampling = std::chrono::milliseconds(20);

// Runs `body` in a child process inside `host`, which the kernel ends with this process.
pid_t in_host(const netns::State& state, netns::Host host, const std::function<void()>& body) {
  std::fflush(nullptr);
  const pid_t parent = ::getpid();
  const pid_t pid = ::fork();
  if (pid < 0) throw process::Failure(process::kFailed, "cannot start a process: fork failed");
  if (pid > 0) return pid;
  // Ctrl-C reaches the parent as well, which then ends this process by SIGTERM; that works also
  // before the node listens for it.
  ::signal(SIGINT, SIG_IGN);
  ::signal(SIGHUP, SIG_IGN);
  ::signal(SIGTERM, SIG_DFL);
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (::getppid() != parent) ::_exit(process::kFailed);
  int code = process::kFine;
  try {
    netns::Testbed::enter(state, host);
    body();
  } catch (const std::exception& error) {
    fmt::print(stderr, "interneuron: {}: {}\n", netns::host_name(host), error.what());
    code = process::kFailed;
  }
  std::fflush(nullptr);
  ::_exit(code);
}

// The vehicle has a link and a peer address per network; the roadside unit accepts peers.
NodeOptions options_of(const netns::State& state, bool vehicle) {
  NodeOptions o;
  // In a testbed, whose addresses are private.
  o.insecure = true;
  for (std::size_t i = 0; i < state.network_count(); ++i) {
    NodeLink link{.id = LinkId{static_cast<std::uint8_t>(i)}, .nic = state.links[i].nic};
    if (vehicle)
      link.peer = fmt::format("{}:{}", state.links[i].road_address, settings::kDefaultPort);
    o.links.push_back(link);
  }
  if (!vehicle) {
    o.port = settings::kDefaultPort;
    o.accept_peers = true;
    return o;
  }
  PipelineConfig pipeline{.id = kPipeline,
                          .stages = offload_stages(),
                          .deadline = kDeadline,
                          .period = kPeriod,
                          .policy = "duplicate"};
  o.pipelines = {pipeline};
  return o;
}

void write_beliefs(fmt::ostream& out, TimePoint now, const std::vector<LinkState>& links) {
  for (const LinkState& l : links) {
    out.print("{},{},{:.4f},{:.6f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n",
              now.time_since_epoch().count(), l.id.value, to_ms(l.rtt_p50), l.loss, l.rate.mbit(),
              l.nature.delay, l.nature.bandwidth, l.nature.reliability, l.nature.security);
  }
  out.flush();
}

void run_vehicle_node(const netns::State& state, bool loaded, const std::filesystem::path& file) {
  auto out = fmt::output_file(file.string());
  Node node(options_of(state, true));
  std::function<void()> sample = [&] {
    write_beliefs(out, node.now(), node.links(*node.peer()));
    node.after(kSampling, sample);
  };
  std::function<void()> send = [&] {
    node.submit(node.begin_round(kPipeline), {Bytes(kMessageBytes)}, MessageClass::kData);
    node.after(kPeriod, send);
  };
  bool sending = false;
  node.on_peer_ready([&](PeerReady) {
    if (loaded && !std::exchange(sending, true)) send();
  });
  node.on_path_changed([&](PathChanged e) {
    out.print("{},{},path,{}\n", node.now().time_since_epoch().count(), e.link.value,
              static_cast<unsigned>(e.to));
  });
  node.stop_on_signals();
  node.after(Duration::zero(), sample);
  node.run();
}

}  // namespace

pid_t start_road(const netns::State& state) {
  return in_host(state, netns::kRoad, [&state] {
    Node node(options_of(state, false));
    node.on_delivered(
        [&node](Delivered d) { node.submit(d.round, {Bytes(1)}, MessageClass::kResult, d.from); });
    node.stop_on_signals();
    node.run();
  });
}

pid_t start_vehicle(const netns::State& state, bool loaded, const std::filesystem::path& file,
                    const std::string& pcap) {
  return in_host(state, netns::kVehicle, [&] {
    std::optional<settings::Capture> capture;
    if (!pcap.empty()) capture.emplace(pcap);
    run_vehicle_node(state, loaded, file);
  });
}

Lines read_lines(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw process::Failure(process::kFailed, "cannot read '" + file.string() + "'");
  Lines lines;
  for (std::string text; std::getline(in, text);) {
    long long at = 0;
    std::size_t link = 0;
    unsigned path = 0;
    Line line;
    if (std::sscanf(text.c_str(), "%lld,%zu,path,%u", &at, &link, &path) == 3) {
      lines.paths.push_back({TimePoint{Duration{at}}, link, static_cast<PathState>(path)});
    } else if (std::sscanf(text.c_str(), "%lld,%zu,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &at, &line.link,
                           &line.rtt_ms, &line.loss, &line.rate_mbit, &line.nature.delay,
                           &line.nature.bandwidth, &line.nature.reliability,
                           &line.nature.security) == 9) {
      line.at = TimePoint{Duration{at}};
      lines.beliefs.push_back(line);
    }
  }
  return lines;
}

}  // namespace interneuron::bench
