// What the operator says of each network card (NIC), on the command line and in the configuration
// file:
//
//   --link 'wwan0=192.0.2.7:47000,role=backup,priority=1,metered,rate_cap=20mbit,trusted'
//
//   [[link]]
//   nic = "wwan0"                 # see node/io/nic_choice.h
//   peer = "192.0.2.7:47000"
//   role = "backup"               # normal, backup or never
//   priority = 1                  # 0 … 255, smaller first
//   metered = true
//   rate_cap_mbit = 20
//   trusted = true
//
// Only the NIC is needed, and the peer where the command talks to one (LinkPeer::kNamed). Names
// become NodeOptions::links, globs, kinds and hardware addresses NodeOptions::rules. Functions
// throw Failure (2, or 3 with file, line and column) with one line that names the thing and the
// remedy.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "interneuron/node.h"

namespace toml {
inline namespace v3 {
class table;
}
}  // namespace toml

namespace interneuron::settings {

// Whether each link says where its peer is: NIC=ADDRESS:PORT, or just NIC.
enum class LinkPeer { kNamed, kNone };

struct LinkOption {
  std::string nic;
  // Empty with LinkPeer::kNone.
  std::string peer;
  LinkTraits traits;
  friend bool operator==(const LinkOption&, const LinkOption&) = default;
};

LinkOption parse_link_option(std::string_view text, LinkPeer peer);
// The option as text that parse_link_option() reads.
std::string to_string(const LinkOption& link);

// An option that is given once per NIC; refuses what parse_link_option() does.
CLI::Option* add_link_option(CLI::App& command, const std::string& names,
                             std::vector<std::string>& texts, LinkPeer peer);

// Appends a link per name, with the smallest ids that are free, and a rule per pattern.
void append_links(const std::vector<std::string>& texts, LinkPeer peer, NodeOptions& options);

// How datagrams pass between the program and its NICs: auto, udp, ring or xdp (docs/transports.md).
CLI::Option* add_transport_option(CLI::App& command, std::string& text);
// auto is udp, which costs no more on the NICs that were measured and needs no privilege.
TransportKind transport_kind(std::string_view text);

// A [[link]] of a configuration file as the command line would give it; `file` for messages.
std::string link_table_text(const toml::table& table, const std::string& file);

}  // namespace interneuron::settings
