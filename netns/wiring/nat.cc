#include "netns/wiring/nat.h"

#include <nftables/libnftables.h>
#include <sys/socket.h>

#include <memory>
#include <string>

#include "netns/state/error.h"
#include "netns/wiring/nic_plan.h"

namespace interneuron::netns {

namespace {

struct ContextDeleter {
  void operator()(nft_ctx* context) const { ::nft_ctx_free(context); }
};

// NICs by their kind, see road_nic() and gateway_nic().
constexpr const char* kToRoads = "\"r*\"";
constexpr const char* kToVehicles = "\"g*\"";

std::string rules(std::size_t networks) {
  std::string text =
      "table ip interneuron {\n chain leaving {\n"
      "  type nat hook postrouting priority 100;\n";
  for (std::size_t n = 0; n < networks; ++n) {
    const Network net(n, AF_INET);
    // By the sender's network rather than by the NIC it leaves from, as a modem that reaches
    // another network's address does so through its own carrier.
    text += std::string("  oifname ") + kToRoads + " ip saddr " + net.everything() + " snat to " +
            net.core() + "\n";
  }
  text += std::string(" }\n}\ntable inet interneuron {\n chain passing {\n") +
          "  type filter hook forward priority 0;\n  iifname " + kToRoads + " oifname " +
          kToVehicles + " ct state != { established, related } drop\n }\n}\n";
  return text;
}

// "Error: Could not process rule: No such file or directory\n..." -> without label and further
// lines.
std::string first_line(std::string text) {
  text = text.substr(0, text.find('\n'));
  const std::size_t label = text.find("Error: ");
  return label == std::string::npos ? text : text.substr(label + 7);
}

}  // namespace

void set_up_nat(std::size_t networks) {
  const std::unique_ptr<nft_ctx, ContextDeleter> context(::nft_ctx_new(NFT_CTX_DEFAULT));
  if (!context) throw TestbedError(1, "cannot set up address translation: out of memory");
  ::nft_ctx_buffer_output(context.get());
  ::nft_ctx_buffer_error(context.get());
  if (::nft_run_cmd_from_buffer(context.get(), rules(networks).c_str()) == 0) return;
  throw TestbedError(1, "cannot set up address translation: " +
                            first_line(::nft_ctx_get_error_buffer(context.get())) +
                            "; the kernel needs nftables with NAT (`modprobe -a nft_ct nft_nat` as "
                            "root loads them), or leave NAT out");
}

}  // namespace interneuron::netns
