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

// Patterns of the core's NICs: those towards roadside units (road_nic()) and towards vehicles
// (gateway_nic()).
constexpr const char* kToRoads = "\"r*\"";
constexpr const char* kToVehicles = "\"g*\"";

std::string rules(std::size_t networks) {
  std::string text =
      "table ip interneuron {\n chain leaving {\n"
      "  type nat hook postrouting priority 100;\n";
  for (std::size_t n = 0; n < networks; ++n) {
    const Network net(n, AF_INET);
    // The sender's network decides, not the NIC by which the packet leaves: a modem that sends to
    // an address of another network does so through its own carrier.
    text += std::string("  oifname ") + kToRoads + " ip saddr " + net.everything() + " snat to " +
            net.core() + "\n";
  }
  text += std::string(" }\n}\ntable inet interneuron {\n chain passing {\n") +
          "  type filter hook forward priority 0;\n  iifname " + kToRoads + " oifname " +
          kToVehicles + " ct state != { established, related } drop\n }\n}\n";
  return text;
}

// The first line of an nftables message, without the label "Error: ".
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
