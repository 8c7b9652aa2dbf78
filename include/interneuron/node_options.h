// What a Node is made of: its links, its pipelines, its threads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/endpoint_options.h"
#include "interneuron/transport.h"

namespace interneuron {

// How datagrams pass between a node and its NICs (docs/transports.md).
enum class TransportKind : std::uint8_t {
  // A UDP socket of the kernel for each link; needs no privilege.
  kUdp,
  // A packet socket with a ring of packets for each link: needs CAP_NET_RAW, and bypasses nftables
  // and NAT of this host.
  kRing,
  // AF_XDP sockets and a program on the NIC for each link: needs CAP_NET_RAW, CAP_NET_ADMIN and
  // CAP_BPF of the host and NICs with Ethernet headers, and bypasses as much.
  kXdp,
};
// "udp", "ring", "xdp".
std::string_view to_string(TransportKind kind);
// The other way round; nothing for another name.
std::optional<TransportKind> parse_transport_kind(std::string_view name);

// A link by the name of its NIC.
struct NodeLink {
  // Unique within the node.
  LinkId id{};
  // The name of a NIC that is there when the node starts, as "wwan0". It need not be ready then,
  // and may come and go where the program is linked with interneuron::monitor. The link's socket is
  // bound to it and sends and receives nowhere else.
  std::string nic;
  LinkTraits traits = {};
  // Numeric address to bind, without port. Default: every address of the NIC, IPv4 if `peer` is
  // IPv4 or (without peer) the NIC has an IPv4 address, else IPv6; answers leave from the address
  // that was asked.
  std::string local_address = {};
  // Where the peer is reached over this link, as "10.0.0.2:47000". Default: this link only answers.
  std::string peer = {};
  // The MTU of the IP layer, in bytes. Default: the NIC's.
  std::size_t mtu = 0;
};

// Links for NICs that are not named one by one: each NIC that matches, now or when it is plugged
// in, becomes a link with the smallest free id; the link ends when the NIC goes.
struct NodeNicRule {
  // A glob of names ("wwan*", which matches no loopback card), "kind:wwan" (docs/links.md) or
  // "mac:02:00:…": these may match nothing for now. A plain name must be that of a NIC that is
  // there when the node starts.
  std::string pattern;
  // The next two are as in NodeLink.
  LinkTraits traits = {};
  std::string peer = {};
};

// What a node is made of; only `links` or `rules` must be given.
struct NodeOptions {
  // Named links and rules; at least one of both. A NIC that is named is no link by a rule, and of
  // the rules the first that matches counts.
  std::vector<NodeLink> links;
  std::vector<NodeNicRule> rules;
  // The local UDP port of every link. Default: any free one, per link.
  std::uint16_t port = 0;
  // The transport of every link.
  TransportKind transport = TransportKind::kUdp;
  // The pipelines whose rounds begin here. Default: none, as on a roadside unit.
  std::vector<PipelineConfig> pipelines;
  // Must hold every policy that the pipelines name. Default: builtin_policies().
  PolicySet policies;
  // Whether peers may come unannounced, as on a roadside unit.
  bool accept_peers = false;
  // How many unannounced peers there may be at a time; further ones are refused.
  std::size_t max_peers = 64;
  // What each peer may take of this node; see EndpointOptions.
  PeerLimits peer_limits = {};
  // Threads that serve peers, 1 … kMaxShards, each with an endpoint and with sockets of its own
  // (docs/load.md, "Several cores"). Each peer belongs to one of them; budgets and max_peers count
  // for all together. With more than one the loop thread serves no peers but hands to the
  // application what the others have for it, so that handlers and methods are used as with one.
  // Only for nodes that are connected to: with accept_peers, over UDP sockets, without pipelines,
  // relays and peers of links.
  std::size_t shards = 1;
  // Numeric addresses without port, as "10.0.0.2", of peers that may send rounds of other origins
  // than themselves; see EndpointOptions.
  std::vector<std::string> relays = {};
  // What incomplete messages of all peers, and messages under way to all peers, may hold, in bytes;
  // see EndpointOptions.
  std::size_t reassembly_budget_bytes = EndpointOptions{}.reassembly_budget_bytes;
  std::size_t send_budget_bytes = EndpointOptions{}.send_budget_bytes;
  // For the experiments that ship with the project; see EndpointOptions.
  std::shared_ptr<const Ablation> ablation{};
  // With what packets are encrypted, and who is trusted; `seed` and `unix_time_ns` are drawn and
  // read by the node where they are zero. Nothing: see `insecure`.
  std::shared_ptr<const Security> security = {};
  // The key of the peer that the links name. Default: the only one that `security` trusts.
  std::optional<PublicKey> peer_key = {};
  // Without `security` packets are sent in the clear and whoever asks is served, which is refused
  // unless this is set. It is meant for experiments in networks of one's own: no address may be
  // public, neither those of NICs that accept peers nor those of peers.
  bool insecure = false;
  // Threads of Queue::kComputation and of Queue::kLocalBackup, 1 … 64 each.
  std::size_t computation_workers = 1;
  std::size_t backup_workers = 1;
  // Puts something of the application's between the node and the socket of a link that was opened,
  // to record or to disturb; called on the loop thread, with several shards for the socket of each,
  // which its thread uses. Must not return nullptr. Default: nothing.
  std::function<std::unique_ptr<Transport>(LinkId, std::unique_ptr<Transport>)> wrap_transport = {};
};

}  // namespace interneuron
