#include "lab/peers_testbed/scenario.h"

#include <algorithm>
#include <array>

namespace interneuron::peers_testbed {
namespace {

using transports::Kind;

constexpr std::array kPeers{
    Peer{"ours_best_link", "Interneuron, the policy best_link: each message over the best link",
         Kind::kOurs, "best_link", true, false, true},
    Peer{"ours_duplicate", "Interneuron, the policy duplicate: each message over both links",
         Kind::kOurs, "duplicate", true, false, true},
    Peer{"ours_down_sampling",
         "Interneuron, the policy down_sampling: over one link, a quarter of it over the other",
         Kind::kOurs, "down_sampling", true, true, true},
    Peer{"ours_coded",
         "Interneuron, the policy coded: over one link, and symbols that make losses good",
         Kind::kOurs, "coded", true, true, true},
    Peer{"ours_stripe", "Interneuron, the policy stripe: each message divided over both links",
         Kind::kOurs, "stripe", true, true, true},
    Peer{"ours_shadow",
         "Interneuron, the policy shadow: over one link, and the other where it fails", Kind::kOurs,
         "shadow", true, true, true},
    Peer{"ours_failover",
         "Interneuron, the policy failover: over one link, what is missing over the other",
         Kind::kOurs, "failover", true, true, true},
    Peer{"udp", "Datagrams of 1500 bytes over the first link; nothing is repaired", Kind::kUdp, "",
         false, false, false},
    Peer{"udp_duplicate", "The same over both links; a message may come in parts of both",
         Kind::kUdp, "", true, false, false},
    Peer{"tcp", "The kernel's TCP with CUBIC over the first link", Kind::kTcp, "cubic", false,
         false, true},
    Peer{"tcp_bbr", "The same with BBR", Kind::kTcp, "bbr", false, false, true},
    Peer{"mptcp", "The kernel's MPTCP with CUBIC over both links, as it comes", Kind::kMptcp,
         "cubic", true, false, true},
    Peer{"mptcp_bbr", "The same with BBR", Kind::kMptcp, "bbr", true, false, true},
    Peer{"srt_backup", "SRT, a bonded group: the second link where the first one fails", Kind::kSrt,
         "backup", true, false, true},
    Peer{"srt_broadcast", "SRT, a bonded group: every packet over both links", Kind::kSrt,
         "broadcast", true, false, true},
    Peer{"fastdds_stock", "Fast DDS as it comes: datagrams of 64 KiB over both links",
         Kind::kFastDds, "stock", true, false, false},
    Peer{"fastdds_tuned", "Fast DDS with datagrams of 1400 bytes and large buffers", Kind::kFastDds,
         "tuned", true, false, false},
};

}  // namespace

std::span<const Peer> all_peers() { return kPeers; }

const Peer* peer_of(std::string_view name) {
  const auto it = std::ranges::find(kPeers, name, &Peer::name);
  return it == kPeers.end() ? nullptr : &*it;
}

}  // namespace interneuron::peers_testbed
