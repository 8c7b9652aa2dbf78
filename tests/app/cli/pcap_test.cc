// A capture of our own packets as an independent witness of what we say and promise.
#include <pcap/pcap.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "interneuron/node.h"
#include "interneuron/pcap_tap.h"
#include "support.h"
#include "tests/node/io/namespace.h"

namespace interneuron::cli::pcap_test {
namespace {

using Json = nlohmann::json;

// LINUX_SLL2: interface index at 4, packet type (4: outgoing) at 10, the IP packet behind it.
constexpr std::size_t kSll2Bytes = 20;
constexpr std::size_t kIpUdpBytes = 28;

struct Packet {
  double at_s = 0;
  int nic = 0;
  bool outgoing = false;
  std::size_t ip_bytes = 0;
  unsigned source_port = 0;
  unsigned type = 0;  // of docs/wire_format.md
};

std::vector<Packet> read_capture(const std::string& file) {
  std::vector<Packet> out;
  std::array<char, PCAP_ERRBUF_SIZE> error{};
  pcap_t* handle = ::pcap_open_offline_with_tstamp_precision(
      file.c_str(), PCAP_TSTAMP_PRECISION_NANO, error.data());
  if (handle == nullptr) return out;
  pcap_pkthdr* header = nullptr;
  const u_char* bytes = nullptr;
  while (::pcap_next_ex(handle, &header, &bytes) == 1) {
    const u_char* ip = bytes + kSll2Bytes;
    if (header->caplen <= kSll2Bytes + kIpUdpBytes || (ip[0] >> 4) != 4) continue;
    Packet p;
    p.at_s = static_cast<double>(header->ts.tv_sec) + static_cast<double>(header->ts.tv_usec) / 1e9;
    p.nic = bytes[4] << 24 | bytes[5] << 16 | bytes[6] << 8 | bytes[7];
    p.outgoing = bytes[10] == 4;
    p.ip_bytes = header->len - kSll2Bytes;
    p.source_port = static_cast<unsigned>(ip[20] << 8 | ip[21]);
    p.type = ip[kIpUdpBytes] & 0x0f;  // the upper half is the version
    out.push_back(p);
  }
  ::pcap_close(handle);
  return out;
}

// --- which NIC carried what

// What the kernel counts as sent by a NIC of the vehicle.
std::uint64_t sent_by(const std::string& testbed, const std::string& nic) {
  const Ran ran = run("testbed run --name " + testbed + " -- ip -s -j link show dev " + nic, false);
  if (ran.code != 0) return 0;
  return Json::parse(ran.output)[0]["stats64"]["tx"]["packets"].get<std::uint64_t>();
}

TEST(PcapWitness, EachNicCarriedWhatWasProbedOverIt) {
  const std::string bed = "pcap-" + std::to_string(::getpid());
  const Ran up = run("testbed up --name " + bed + " --profile a=clean,b=clean --backend emulator");
  if (up.code != 0) GTEST_SKIP() << up.output;
  const TempFolder folder;
  const std::string file = (folder / "x.pcap").string();
  std::map<std::string, std::uint64_t> before;
  for (const std::string nic : {"ifa", "ifb"}) before[nic] = sent_by(bed, nic);
  // Nobody answers; what leaves is what is looked at.
  const Ran ran =
      run("--pcap " + file + " testbed run --name " + bed + " -- '" + places::program() +
              "' probe --insecure --nic ifa=10.77.0.1 --count 200 --interval 2ms --timeout 100ms "
              "--no-rate --json; ",
          false);
  const Json json = Json::parse(ran.output);
  EXPECT_EQ(json["nics"][0]["sent_packets"], 200);
  std::map<int, std::size_t> seen;
  for (const Packet& p : read_capture(file)) {
    EXPECT_EQ(p.type, 4U);
    seen[p.nic] += p.outgoing ? 1 : 0;
  }
  ASSERT_EQ(seen.size(), 1U) << "one NIC carried it";
  EXPECT_EQ(seen.begin()->second, 200U);
  const std::uint64_t sent = sent_by(bed, "ifa") - before["ifa"];
  const std::uint64_t other = sent_by(bed, "ifb") - before["ifb"];
  run("testbed down --name " + bed);
  // The kernel's own (router solicitations) come on top.
  EXPECT_GE(sent, 200U);
  EXPECT_LE(sent, 210U);
  EXPECT_LE(other, 10U);
}

// --- what an idle session costs

struct Idle {
  double trains_kbit = 0;      // all of them, less what the first may use at once
  double heartbeats_kbit = 0;  // once the first train and what comes of it are over
};

// The first trains of a path may use this at once (src/core/link/probe_schedule.cc). The mean of a
// few seconds without it depends on which trains fall into them, and that on how busy the machine
// was; with it, the budget holds at every instant.
constexpr double kFirstTrainsKbit = 2'000;

// What two nodes that have nothing to say to each other send over one link for `seconds`, by the
// port it comes from.
std::map<unsigned, Idle> idle_session(double settle_s, double seconds, const std::string& file) {
  NodeOptions serving;
  serving.insecure = true;  // what kind of packets they are is looked at
  serving.accept_peers = true;
  serving.port = 47000;
  NodeLink link{.nic = "lo", .local_address = "127.0.0.1"};
  serving.links.push_back(link);
  NodeOptions calling = serving;
  calling.accept_peers = false;
  calling.port = 47001;
  calling.links[0].peer = "127.0.0.1:47000";

  PcapTap tap(file);
  Node road(serving);
  Node vehicle(calling);
  std::thread serve([&road] { road.run(); });
  std::thread call([&vehicle] { vehicle.run(); });
  // What is measured is what is sent in a stretch of time.
  std::this_thread::sleep_for(std::chrono::duration<double>(settle_s + seconds));
  vehicle.post([&vehicle] { vehicle.stop(); });
  road.post([&road] { road.stop(); });
  serve.join();
  call.join();
  tap.stop();

  const std::vector<Packet> packets = read_capture(file);
  std::map<unsigned, Idle> out;
  if (packets.empty()) return out;
  const double begin = packets.front().at_s;
  for (const Packet& p : packets) {
    const double after_s = p.at_s - begin;
    const double kbit = 8e-3 * static_cast<double>(p.ip_bytes);
    Idle& idle = out[p.source_port];
    if (after_s >= settle_s + seconds) continue;
    if (p.type == 3) {
      idle.trains_kbit += kbit / (settle_s + seconds);
    } else if (after_s >= settle_s) {
      idle.heartbeats_kbit += kbit / seconds;
    }
  }
  for (auto& [port, idle] : out) idle.trains_kbit -= kFirstTrainsKbit / (settle_s + seconds);
  return out;
}

TEST(PcapWitness, AnIdleSessionCostsLittle) {
  io::in_namespace([] {
    constexpr double kHeartbeatsKbit = 30;  // per direction and link, at IP level
    constexpr double kTrainsKbit = 150;     // mean
    const TempFolder folder;
    const auto idle = idle_session(3, 10, (folder / "idle.pcap").string());
    EXPECT_EQ(idle.size(), 2) << "both directions are heard";
    for (const auto& [port, sent] : idle) {
      std::printf("from port %u: heartbeats %.1f kbit/s, trains %.1f kbit/s\n", port,
                  sent.heartbeats_kbit, sent.trains_kbit);
      EXPECT_LE(sent.heartbeats_kbit, kHeartbeatsKbit) << "heartbeats of at most 30 kbit/s";
      EXPECT_LE(sent.trains_kbit, kTrainsKbit) << "trains of at most 150 kbit/s";
    }
  });
}

TEST(PcapOption, AFileThatCannotBeWrittenIsNamed) {
  if (::geteuid() != 0) GTEST_SKIP() << "capturing needs CAP_NET_RAW";
  const Ran ran = run("probe --insecure --peer 127.0.0.1 --pcap /nowhere/x.pcap");
  EXPECT_EQ(ran.code, 1) << ran.output;
  EXPECT_NE(ran.output.find("/nowhere/x.pcap"), std::string::npos) << ran.output;
  EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
}

TEST(PcapOption, WithoutThePrivilegeThereIsACommandAndExitCodeFive) {
  if (::geteuid() != 0) GTEST_SKIP() << "root can become nobody";
  const std::string command = "setpriv --reuid=65534 --regid=65534 --clear-groups '" +
                              places::program() +
                              "' probe --insecure --peer 127.0.0.1 --pcap /dev/null 2>&1";
  FILE* pipe = ::popen(command.c_str(), "r");
  std::string output;
  std::array<char, 4096> chunk;
  while (const std::size_t n = std::fread(chunk.data(), 1, chunk.size(), pipe)) {
    output.append(chunk.data(), n);
  }
  const int status = ::pclose(pipe);
  if (WEXITSTATUS(status) >= 126) GTEST_SKIP() << output;
  EXPECT_EQ(WEXITSTATUS(status), 5) << output;
  EXPECT_NE(output.find("setcap cap_net_raw+ep"), std::string::npos) << output;
}

}  // namespace
}  // namespace interneuron::cli::pcap_test
