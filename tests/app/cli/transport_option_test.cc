// `--transport` of the programs that have it.
#include <algorithm>

#include "support.h"

namespace interneuron::cli {
namespace {

TEST(TransportOption, IsInTheHelpAndRefusesWhatThereIsNot) {
  for (const char* program : {"vehicle", "road"}) {
    const Ran help = run(std::string(program) + " --help");
    EXPECT_NE(help.output.find("bypasses nftables"), std::string::npos) << help.output;
    EXPECT_EQ(run(std::string(program) + " --transport pigeon").code, 2);
  }
}

TEST(TransportOption, ARingWithoutThePrivilegeIsAnErrorWithTheRemedy) {
  // By name and by rule, which would wait for its NICs otherwise.
  for (const char* nic : {"lo", "'l*'"}) {
    const std::string arguments = std::string("road --ladder none --transport ring --nic ") + nic;
    const Ran ran =
        ::getuid() == 0
            ? run_program("setpriv", "--bounding-set -net_raw --inh-caps -net_raw '" +
                                         std::string(INTERNEURON_PROGRAM) + "' " + arguments)
            : run(arguments);
    EXPECT_EQ(ran.code, 5) << ran.output;
    EXPECT_NE(ran.output.find("setcap cap_net_raw+ep"), std::string::npos) << ran.output;
    EXPECT_NE(ran.output.find("--transport udp"), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  }
}

}  // namespace
}  // namespace interneuron::cli
