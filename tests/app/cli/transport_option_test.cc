// `--transport` of the programs that have it.
#include <algorithm>
#include <fstream>

#include "support.h"

namespace interneuron::cli::transport_option_test {
namespace {

TEST(TransportOption, IsInTheHelpAndRefusesWhatThereIsNot) {
  for (const char* program : {"vehicle", "road", "bench peers", "bench load --testbed"}) {
    const Ran help = run(std::string(program) + " --help");
    EXPECT_NE(help.output.find("bypass nftables"), std::string::npos) << help.output;
    EXPECT_EQ(run(std::string(program) + " --transport pigeon").code, 2);
  }
  EXPECT_EQ(run("bench load rate --transport ring").code, 2);
}

// Whatever says so, before anything is opened or written.
TEST(TransportOption, ACaptureOfXdpIsRefused) {
  const TempFolder folder;
  const std::string file = (folder / "x.pcap").string();
  const std::string config = (folder / "c.toml").string();
  std::ofstream(config) << "transport = \"xdp\"\n";
  const std::string option = "--pcap '" + file + "' ";
  for (const std::string& arguments :
       {option + "road --ladder none --nic lo --transport xdp",
        option + "road --ladder none --nic lo --config '" + config + "'",
        option + "vehicle --link lo=127.0.0.1:9 --transport xdp",
        option + "bench peers clean --messages 1 --peer ours_best_link --transport xdp"}) {
    const Ran ran = run(arguments);
    EXPECT_EQ(ran.code, 2) << ran.output;
    EXPECT_NE(ran.output.find("--pcap cannot see"), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
    EXPECT_FALSE(std::filesystem::exists(file));
  }
}

// `capability`: the one that the program is run without, as setpriv calls it.
Ran run_without(const std::string& capability, const std::string& arguments) {
  if (::getuid() != 0) return run(arguments);
  const std::string without = " -" + capability;
  return run_program("setpriv", "--bounding-set" + without + " --inh-caps" + without + " '" +
                                    places::program() + "' " + arguments);
}

void expect_that_it_is_refused(const std::string& transport, const std::string& capability,
                               const std::string& remedy) {
  // By name and by rule, which would wait for its NICs otherwise.
  for (const char* nic : {"lo", "'l*'"}) {
    const std::string arguments =
        "road --insecure --ladder none --transport " + transport + " --nic " + std::string(nic);
    const Ran ran = run_without(capability, arguments);
    EXPECT_EQ(ran.code, 5) << ran.output;
    EXPECT_NE(ran.output.find(remedy), std::string::npos) << ran.output;
    EXPECT_NE(ran.output.find("--transport udp"), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
}

TEST(TransportOption, ARingWithoutThePrivilegeIsAnErrorWithTheRemedy) {
  expect_that_it_is_refused("ring", "net_raw", "setcap cap_net_raw+ep");
}

TEST(TransportOption, XdpWithoutThePrivilegeIsAnErrorWithTheRemedy) {
  // Without the first the kernel asks for the second instead.
  expect_that_it_is_refused("xdp", "bpf,-sys_admin", "setcap cap_net_raw,cap_net_admin,cap_bpf");
}

TEST(TransportOption, XdpWithoutLockedMemoryIsAnErrorWithTheRemedy) {
  if (::getuid() != 0) GTEST_SKIP() << "needs root of the host, for XDP";
  for (const char* nic : {"lo", "l*"}) {
    const Ran ran = run_program(
        "sh",
        "-c 'ulimit -l 1024 && exec setpriv --bounding-set -ipc_lock --inh-caps -ipc_lock "
        "\"" +
            places::program() + "\" road --insecure --ladder none --transport xdp --nic \"" +
            std::string(nic) + "\"'");
    EXPECT_EQ(ran.code, 5) << ran.output;
    EXPECT_NE(ran.output.find("cap_ipc_lock"), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
}

// What a bench starts in a host of its testbed.
TEST(TransportOption, AnEndOfABenchWithoutThePrivilegeSaysSo) {
  const TempFolder folder;
  const std::string file = (folder / "order.json").string();
  std::ofstream(file) << R"({"transport": "ours", "mode": "best_link",
    "traffic": {"variant_bytes": [1000], "deadline_ns": 1, "period_ns": 1, "length_ns": 1, "first_ns": [0]},
    "modems": [{"nic": "lo", "vehicle": "127.0.0.1", "road": "127.0.0.1"}],
    "datagrams": "ring", "way_ns": 0})";
  for (const char* end : {"vehicles", "road"}) {
    EXPECT_THAT(run_without("net_raw", "bench play --order '" + file + "' --end " + end),
                EndsSaying(5, "setcap cap_net_raw+ep"));
  }
}

TEST(TransportOption, ABenchWithoutThePrivilegeIsAnErrorWithTheRemedy) {
  if (::getuid() != 0) GTEST_SKIP() << "in its own user namespace a testbed has the privilege";
  EXPECT_THAT(run_without("net_raw", "bench peers clean --messages 1 --peer udp --transport ring"),
              EndsSaying(5, "CAP_NET_RAW"));
}

// The kernel asks for CAP_BPF in the first user namespace, so that a testbed has it of nobody.
TEST(TransportOption, ABenchTellsOfThePrivilegeThatItsEndLacks) {
  if (const std::string reason = no_testbed(); !reason.empty()) GTEST_SKIP() << reason;
  EXPECT_THAT(run_without("bpf,-sys_admin",
                          "bench peers clean --messages 1 --peer ours_best_link --transport xdp"),
              EndsSaying(5, "setcap cap_net_raw,cap_net_admin,cap_bpf"));
}

}  // namespace
}  // namespace interneuron::cli::transport_option_test
