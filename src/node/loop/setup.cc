#include "node/loop/link_set.h"

#include <algorithm>
#include <cerrno>
#include <random>
#include <stdexcept>

#include "interneuron/sizes.h"
#include "node/io/address.h"
#include "node/io/nic_choice.h"
#include "node/io/open_transport.h"
#include "node/io/socket_group.h"
#include "node/io/steady_clock.h"

namespace interneuron {

namespace {

// Threads per queue. No measurement behind this value: it only has to be larger than the processors
// of a vehicle or a roadside unit.
constexpr std::size_t kMaxWorkers = 64;

void check_workers(std::size_t count, const char* name) {
  if (count >= 1 && count <= kMaxWorkers) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(count) +
                              "; it must be 1 to " + std::to_string(kMaxWorkers));
}

std::optional<Address> peer_of(const NodeLink& link) {
  if (link.peer.empty()) return std::nullopt;
  const auto peer = parse_address(link.peer);
  if (peer && port_of(*peer) != 0 && !is_unspecified(*peer)) return peer;
  throw std::invalid_argument("the peer address \"" + link.peer + "\" of " + link.nic +
                              " is not like 10.0.0.2:47000 or [2001:db8::2]:47000");
}

Address relay_of(const std::string& relay) {
  const auto address = make_address(relay, 0);
  if (address && !is_unspecified(*address)) return *address;
  throw std::invalid_argument("the relay \"" + relay +
                              "\" is no numeric address without port like 10.0.0.2");
}

// The address to which a link's socket is bound; see NodeLink::local_address.
Address local_of(const NodeLink& link, const io::Nic& nic, const Binding& binding) {
  const auto peer = peer_of(link);
  if (!link.local_address.empty()) {
    const auto local = make_address(link.local_address, binding.port);
    if (!local) {
      throw std::invalid_argument("the local address \"" + link.local_address + "\" of " +
                                  link.nic + " is no numeric address like 10.0.0.1");
    }
    if (peer && is_ipv6(*peer) != is_ipv6(*local)) {
      throw std::invalid_argument("the local address " + link.local_address + " of " + link.nic +
                                  " and its peer " + link.peer + " are not of the same kind");
    }
    return *local;
  }
  if (binding.source) return io::with_port(*binding.source, binding.port);
  const bool only_ipv6 = !nic.addresses.empty() && is_ipv6(nic.addresses.front());
  const bool ipv6 = peer ? is_ipv6(*peer) : only_ipv6;
  return *make_address(ipv6 ? "::" : "0.0.0.0", binding.port);
}

constexpr const char* kInsecureRemedy =
    ", where nothing is sent in the clear; use keys (`interneuron keys gen`) instead of --insecure";

void refuse_public(const NodeLink& link, const Address& local, const io::Nic& nic) {
  static const std::string remedy = std::string(kInsecureRemedy) + ", or bind a private address";
  if (!is_unspecified(local)) {
    if (is_private(local)) return;
    throw std::invalid_argument(io::host_text(local) + " on " + link.nic + " is a public address" +
                                remedy);
  }
  bool any = false;
  for (const Address& address : nic.addresses) {
    if (is_ipv6(address) != is_ipv6(local)) continue;
    any = true;
    if (!is_private(address)) {
      throw std::invalid_argument(link.nic + " has the public address " + io::host_text(address) +
                                  remedy);
    }
  }
  if (!any) throw std::invalid_argument(link.nic + " has no address that is known" + remedy);
}

// Messages would be cut into pieces that the card does not carry, and none would ever arrive.
void refuse_small(const LinkInfo& link, bool is_v6) {
  const std::size_t least = kLeastDatagramBytes + (is_v6 ? kIpv6UdpBytes : kIpv4UdpBytes);
  if (link.mtu >= least) return;
  throw IoError(link.name + " has an MTU of " + std::to_string(link.mtu) + " bytes, and at least " +
                    std::to_string(least) + " are needed; set it to 1280",
                0);
}

// Whether addresses of NICs that serve have to be private.
bool serves_in_the_clear(const NodeOptions& options) {
  return options.accept_peers && !options.security;
}

bool names_a_peer(const NodeOptions& options) {
  return std::ranges::any_of(options.links, [](const NodeLink& l) { return !l.peer.empty(); }) ||
         std::ranges::any_of(options.rules, [](const NodeNicRule& r) { return !r.peer.empty(); });
}

void check_shards(const NodeOptions& options) {
  if (options.shards < 1 || options.shards > kMaxShards) {
    throw std::invalid_argument("shards is " + std::to_string(options.shards) +
                                "; it must be 1 to " + std::to_string(kMaxShards));
  }
  if (options.shards == 1) return;
  const auto refuse = [](const std::string& why) {
    throw std::invalid_argument("a node of several shards " + why + "; take one shard");
  };
  if (!options.accept_peers || names_a_peer(options))
    refuse("is connected to and connects to none");
  if (options.transport != TransportKind::kUdp) refuse("has UDP sockets");
  if (!options.pipelines.empty()) refuse("begins no rounds");
  if (!options.relays.empty()) refuse("has no relays, whose rounds are of many peers");
}

void check_security(const NodeOptions& options) {
  if (!options.security) {
    if (options.insecure) return;
    throw std::invalid_argument(
        "a node needs keys (NodeOptions::security); NodeOptions::insecure does without, in a "
        "network of one's own");
  }
  if (options.insecure) {
    throw std::invalid_argument("NodeOptions::insecure is for nodes without keys, and there are");
  }
  const Security& security = *options.security;
  if (security.key == SecretKey{}) {
    throw std::invalid_argument("NodeOptions::security has no private key");
  }
  if (!options.peer_key) {
    if (!names_a_peer(options) || security.peers.size() == 1) return;
    throw std::invalid_argument("NodeOptions::peer_key has to say which of " +
                                std::to_string(security.peers.size()) +
                                " trusted hosts the links name");
  }
  if (std::ranges::find(security.peers, *options.peer_key, &TrustedPeer::key) ==
      security.peers.end()) {
    throw std::invalid_argument("the peer's key " + to_base64(*options.peer_key) +
                                " is not among those that NodeOptions::security trusts");
  }
}

// The keys with what the caller leaves to the node.
std::shared_ptr<const Security> completed(const Security& given) {
  // Also makes libsodium ready, which must be before anything else is asked of it.
  const SecretKey drawn = random_key();
  auto out = std::make_shared<Security>(given);
  if (out->seed == SecretKey{}) out->seed = drawn;
  if (out->unix_time_ns == 0) out->unix_time_ns = io::unix_time_ns();
  return out;
}

}  // namespace

void check_peer_address(const NodeOptions& options, const Address& peer) {
  if (options.security || is_private(peer)) return;
  throw std::invalid_argument("the peer " + to_string(peer) + " has a public address" +
                              kInsecureRemedy);
}

void check_options(const NodeOptions& options) {
  if (options.links.empty() && options.rules.empty()) {
    throw std::invalid_argument("a node needs at least one link");
  }
  check_security(options);
  check_shards(options);
  for (const NodeNicRule& rule : options.rules) {
    const std::string wrong = io::nic_pattern_error(rule.pattern);
    if (!wrong.empty()) throw std::invalid_argument(wrong);
    const auto peer = peer_of({.nic = rule.pattern, .peer = rule.peer});
    if (peer) check_peer_address(options, *peer);
  }
  for (const NodeLink& link : options.links) {
    if (const auto peer = peer_of(link)) check_peer_address(options, *peer);
  }
  for (std::size_t i = 0; i < options.links.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (options.links[i].id != options.links[j].id) continue;
      throw std::invalid_argument("the links " + options.links[j].nic + " and " +
                                  options.links[i].nic + " have the same id " +
                                  std::to_string(options.links[i].id.value));
    }
  }
  check_workers(options.computation_workers, "computation_workers");
  check_workers(options.backup_workers, "backup_workers");
  // A NIC that a rule matches and that cannot be opened is only told of; this is true of them all.
  io::require_privilege(options.transport);
}

EndpointOptions endpoint_options(const NodeOptions& options) {
  EndpointOptions out;
  std::random_device random;
  while (out.session.value == 0) out.session.value = random();
  for (std::uint64_t& word : out.secret) word = std::uint64_t{random()} << 32U | random();
  out.pipelines = options.pipelines;
  out.policies = options.policies.empty() ? builtin_policies() : options.policies;
  out.accept_peers = options.accept_peers;
  out.max_peers = options.max_peers;
  out.peer_limits = options.peer_limits;
  for (const std::string& relay : options.relays) out.relays.push_back(relay_of(relay));
  if (options.security) out.security = completed(*options.security);
  out.ablation = options.ablation;
  out.reassembly_budget_bytes = options.reassembly_budget_bytes;
  out.send_budget_bytes = options.send_budget_bytes;
  if (options.shards > 1) {
    out.shard = {static_cast<std::uint8_t>(options.shards), 0, std::make_shared<SharedHoldings>()};
  }
  return out;
}

void check_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic) {
  const Address local = local_of(link, nic, {.port = options.port});
  if (serves_in_the_clear(options) && !is_unspecified(local)) refuse_public(link, local, nic);
}

namespace {

// The transport of a link, or those of its shards.
OpenedLink open_sockets(const NodeOptions& options, const io::UdpOptions& udp) {
  OpenedLink out;
  if (options.shards == 1) {
    io::OpenTransport opened = io::open_transport(options.transport, udp);
    out.transport = std::move(opened.transport);
    out.warnings = std::move(opened.warnings);
    return out;
  }
  io::SocketGroup group = io::open_socket_group(udp, static_cast<std::uint8_t>(options.shards),
                                                options.security != nullptr);
  out.transport = std::move(group.transports.front());
  group.transports.erase(group.transports.begin());
  out.siblings = std::move(group.transports);
  out.warnings = std::move(group.warnings);
  return out;
}

}  // namespace

OpenedLink open_link(const NodeOptions& options, const NodeLink& link, const io::Nic& nic,
                     const Binding& binding) {
  io::UdpOptions udp{.nic = link.nic,
                     .card = nic,
                     .local = local_of(link, nic, binding),
                     .answer_from_receiver = link.peer.empty(),
                     .may_wait = binding.may_wait};
  if (serves_in_the_clear(options)) refuse_public(link, udp.local, nic);
  const LinkInfo info{link.nic, link.mtu != 0 ? link.mtu : nic.mtu, link.traits};
  refuse_small(info, is_ipv6(udp.local));
  OpenedLink out;
  try {
    out = open_sockets(options, udp);
  } catch (const IoError& error) {
    if (error.code() != EADDRINUSE || options.port == binding.port) throw;
    udp.local = io::with_port(udp.local, options.port);
    out = open_sockets(options, udp);
  }
  out.info = info;
  if (options.wrap_transport) {
    out.transport = options.wrap_transport(link.id, std::move(out.transport));
    for (auto& sibling : out.siblings) {
      sibling = options.wrap_transport(link.id, std::move(sibling));
    }
  }
  return out;
}

bool still_fits(const NodeOptions& options, const NodeLink& link, const Address& local,
                const io::Nic& nic) {
  const Address host = io::with_port(local, 0);
  if (!is_unspecified(local) && !is_loopback(local) &&
      std::ranges::find(nic.addresses, host) == nic.addresses.end()) {
    return false;
  }
  if (!serves_in_the_clear(options)) return true;
  try {
    refuse_public(link, local, nic);
  } catch (const std::invalid_argument&) {
    return false;
  }
  return true;
}

}  // namespace interneuron
