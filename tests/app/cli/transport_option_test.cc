// `--transport` of the programs that have it.
#include <algorithm>

#include "support.h"

namespace interneuron::cli {
namespace {

TEST(TransportOption, IsInTheHelpAndRefusesWhatThereIsNot) {
  for (const char* program : {"vehicle", "road"}) {
    const Ran help = run(std::string(program) + " --help");
    EXPECT_NE(help.output.find("bypass nftables"), std::string::npos) << help.output;
    EXPECT_EQ(run(std::string(program) + " --transport pigeon").code, 2);
  }
}

// `capability`: the one that the program is run without, as setpriv calls it.
void expect_that_it_is_refused(const std::string& transport, const std::string& capability,
                               const std::string& remedy) {
  // By name and by rule, which would wait for its NICs otherwise.
  for (const char* nic : {"lo", "'l*'"}) {
    const std::string arguments =
        "road --ladder none --transport " + transport + " --nic " + std::string(nic);
    const std::string without = " -" + capability;
    const Ran ran =
        ::getuid() == 0
            ? run_program("setpriv", "--bounding-set" + without + " --inh-caps" + without + " '" +
                                         std::string(INTERNEURON_PROGRAM) + "' " + arguments)
            : run(arguments);
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

}  // namespace
}  // namespace interneuron::cli
