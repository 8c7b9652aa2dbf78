#include "app/settings/link_options.h"

#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>

#include "app/process/failure.h"
#include "app/toml/toml_reader.h"
#include "node/io/nic_choice.h"

namespace interneuron::settings {
namespace {

// More ranks than a host has NICs.
constexpr int kMaxPriority = 255;
// 1 Tbit/s, beyond any NIC.
constexpr double kMaxCapMbit = 1e6;

struct Role {
  std::string_view name;
  LinkRole role;
};
constexpr Role kRoles[] = {
    {"normal", LinkRole::kNormal}, {"backup", LinkRole::kBackup}, {"never", LinkRole::kNever}};

// The names of the attributes. The configuration file uses the same, except for the rate cap, whose
// key carries its unit.
const std::vector<std::string_view> kAttributes = {"role", "priority", "metered", "rate_cap",
                                                   "trusted"};
constexpr std::string_view kRoleRange = "give normal, backup or never";
constexpr std::string_view kPriorityRange = "give a whole number from 0 to 255, smaller first";
constexpr std::string_view kCapRange = "give a rate above 0, for example 20mbit or 500kbit";

std::string in_quotes(std::string_view text) { return "'" + std::string(text) + "'"; }

std::string did_you_mean(std::string_view word, const std::vector<std::string_view>& known) {
  if (const auto nearest = toml_reader::nearest_word(word, known)) {
    return "; did you mean " + in_quotes(*nearest) + "?";
  }
  std::string text = "; there are";
  for (const std::string_view name : known) text += " " + std::string(name);
  return text;
}

[[noreturn]] void refuse(std::string_view text, const std::string& what) {
  throw process::Failure(process::kUsage,
                         toml_reader::one_line("--link " + in_quotes(text) + ": " + what));
}

constexpr std::string_view kPeerForm = "give NIC=ADDRESS:PORT, for example wwan0=192.0.2.7:47000";

// What is wrong with the peer's address, and the remedy. A name is not looked up: the answer would
// depend on the card that the question leaves through, and each card may need another address.
std::string peer_error(std::string_view peer, std::string_view form) {
  const std::size_t colon = peer.rfind(':');
  const std::string_view host = peer.substr(0, colon);
  const bool letters = std::ranges::any_of(
      host, [](char c) { return (c >= 'g' && c <= 'z') || (c >= 'G' && c <= 'Z'); });
  const bool name = letters && host.find_first_of("[]:%") == std::string_view::npos;
  if (!name || colon == std::string_view::npos) return std::string(form);
  return in_quotes(host) + " is a name, and a link needs an address: " + std::string(form) +
         "; `getent ahosts " + std::string(host) + "` tells the addresses of a name";
}

std::optional<LinkRole> role_of(std::string_view name) {
  for (const Role& role : kRoles) {
    if (role.name == name) return role.role;
  }
  return std::nullopt;
}

template <class Number>
std::optional<std::pair<Number, std::string_view>> leading_number(std::string_view text) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{}) return std::nullopt;
  return std::pair{value, text.substr(static_cast<std::size_t>(end - text.data()))};
}

std::optional<DataRate> rate_of_text(std::string_view text) {
  const auto number = leading_number<double>(text);
  if (!number || !std::isfinite(number->first)) return std::nullopt;
  double mbit = number->first;
  if (number->second == "kbit") {
    mbit /= 1000;
  } else if (number->second == "gbit") {
    mbit *= 1000;
  } else if (number->second != "mbit") {
    return std::nullopt;
  }
  // Rounded, so that 0.123 Mbit/s is 123000 bit/s and not 122999.
  const DataRate rate{std::llround(std::min(mbit, kMaxCapMbit) * 1e6)};
  if (rate.bits_per_second <= 0) return std::nullopt;
  return rate;
}

// One "key" or "key=value" behind the NIC.
void read_attribute(std::string_view text, std::string_view attribute, LinkTraits& traits) {
  const std::size_t at = attribute.find('=');
  const std::string_view key = attribute.substr(0, at);
  const std::optional<std::string_view> value =
      at == std::string_view::npos ? std::nullopt : std::optional(attribute.substr(at + 1));
  const auto wants = [&](std::string_view range) {
    refuse(text,
           std::string(key) + (value ? " = " + in_quotes(*value) : "") + ": " + std::string(range));
  };
  if (key == "role") {
    const auto role = role_of(value.value_or(""));
    if (!role) wants(kRoleRange);
    traits.role = *role;
  } else if (key == "priority") {
    const auto number = leading_number<int>(value.value_or(""));
    if (!number || !number->second.empty() || number->first < 0 || number->first > kMaxPriority) {
      wants(kPriorityRange);
    }
    traits.priority = number->first;
  } else if (key == "rate_cap") {
    traits.rate_cap = rate_of_text(value.value_or(""));
    if (!traits.rate_cap) wants(kCapRange);
  } else if (key == "metered" || key == "trusted") {
    if (value && *value != "true" && *value != "false")
      wants("stands alone, or give true or false");
    (key == "metered" ? traits.metered : traits.trusted) = value.value_or("true") == "true";
  } else {
    refuse(text, "unknown attribute " + in_quotes(key) + did_you_mean(key, kAttributes));
  }
}

}  // namespace

LinkOption parse_link_option(std::string_view text, LinkPeer peer) {
  LinkOption link;
  std::string_view rest = text;
  std::string_view head = rest.substr(0, rest.find(','));
  rest.remove_prefix(std::min(rest.size(), head.size() + 1));
  const std::size_t at = head.find('=');
  link.nic = head.substr(0, at);
  if (peer == LinkPeer::kNamed) {
    if (at != std::string_view::npos) link.peer = head.substr(at + 1);
    if (link.nic.empty() || !parse_address(link.peer)) {
      refuse(text, link.nic.empty() ? std::string(kPeerForm) : peer_error(link.peer, kPeerForm));
    }
  } else if (link.nic.empty() || at != std::string_view::npos) {
    refuse(text, "give NIC, for example eth0 or eth0,trusted");
  }
  if (const std::string wrong = io::nic_pattern_error(link.nic); !wrong.empty()) {
    refuse(text, wrong);
  }
  while (!rest.empty()) {
    const std::string_view attribute = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), attribute.size() + 1));
    read_attribute(text, attribute, link.traits);
  }
  return link;
}

std::string to_string(const LinkOption& link) {
  std::string text = link.nic;
  if (!link.peer.empty()) text += "=" + link.peer;
  const LinkTraits& t = link.traits;
  for (const Role& role : kRoles) {
    if (role.role == t.role && t.role != LinkRole::kNormal) {
      text += ",role=" + std::string(role.name);
    }
  }
  if (t.priority != 0) text += ",priority=" + std::to_string(t.priority);
  if (t.metered) text += ",metered";
  if (t.rate_cap) text += ",rate_cap=" + toml_reader::number_text(t.rate_cap->mbit()) + "mbit";
  if (t.trusted) text += ",trusted";
  return text;
}

CLI::Option* add_link_option(CLI::App& command, const std::string& names,
                             std::vector<std::string>& texts, LinkPeer peer) {
  const std::string form = peer == LinkPeer::kNamed
                               ? "NIC=ADDRESS:PORT of the peer as reached over "
                                 "this card"
                               : "Network card";
  CLI::Option* option = command.add_option(
      names, texts,
      form +
          "; once per card. NIC: a name, a glob (wwan*) or kind:wwan. Behind it, joined by "
          "commas: role=backup|never, priority=N, metered, rate_cap=20mbit, trusted");
  option->take_all();
  option->check([peer](const std::string& text) -> std::string {
    try {
      parse_link_option(text, peer);
      return "";
    } catch (const process::Failure& failure) {
      // Without "--link ": the caller puts the option's name before it.
      const std::string what = failure.what();
      return what.substr(what.find('\''));
    }
  });
  return option;
}

CLI::Option* add_transport_option(CLI::App& command, std::string& text) {
  return command
      .add_option("--transport", text,
                  "auto, udp, ring or xdp: the last two are beside the kernel's IP layer, bypass "
                  "nftables and NAT of this host, and need CAP_NET_RAW; xdp also CAP_NET_ADMIN and "
                  "CAP_BPF")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "udp", "ring", "xdp"}));
}

TransportKind transport_kind(std::string_view text) {
  return parse_transport_kind(text).value_or(TransportKind::kUdp);
}

void append_links(const std::vector<std::string>& texts, LinkPeer peer, NodeOptions& options) {
  std::set<LinkId> taken;
  for (const NodeLink& link : options.links) taken.insert(link.id);
  for (const std::string& text : texts) {
    const LinkOption link = parse_link_option(text, peer);
    if (io::is_nic_rule(link.nic)) {
      options.rules.push_back({.pattern = link.nic, .traits = link.traits, .peer = link.peer});
      continue;
    }
    NodeLink named;
    while (taken.contains(named.id)) ++named.id.value;
    taken.insert(named.id);
    named.nic = link.nic;
    named.traits = link.traits;
    named.peer = link.peer;
    options.links.push_back(named);
  }
}

// --- the configuration file

namespace {

// The keys of one [[link]], with the place of what is wrong.
class LinkTable {
 public:
  LinkTable(const toml::table& table, const std::string& file) : table_(table), file_(file) {}

  std::string text() {
    for (const auto& [key, node] : table_) read(std::string(key.str()), node);
    if (link_.nic.empty()) {
      fail(table_, "[[link]] without nic; give for example nic = \"wwan0\"");
    }
    return to_string(link_);
  }

 private:
  [[noreturn]] void fail(const toml::node& node, const std::string& what) const {
    const toml::source_position at = node.source().begin;
    throw process::Failure(process::kConfiguration,
                           toml_reader::one_line(file_ + ":" + std::to_string(at.line) + ":" +
                                                 std::to_string(at.column) + ": " + what));
  }
  template <class T>
  T value(const std::string& key, const toml::node& node, std::string_view range) const {
    if (const auto found = node.value_exact<T>()) return *found;
    fail(node, key + ": " + std::string(range));
  }
  void read(const std::string& key, const toml::node& node);

  const toml::table& table_;
  const std::string& file_;
  LinkOption link_;
};

void LinkTable::read(const std::string& key, const toml::node& node) {
  LinkTraits& traits = link_.traits;
  if (key == "nic") {
    link_.nic = value<std::string>(key, node, "give a name in quotes, for example \"wwan0\"");
  } else if (key == "peer") {
    link_.peer = value<std::string>(key, node, "give ADDRESS:PORT in quotes");
    if (!parse_address(link_.peer)) {
      fail(node, "peer " + in_quotes(link_.peer) + ": " +
                     peer_error(link_.peer, "give ADDRESS:PORT, for example 192.0.2.7:47000"));
    }
  } else if (key == "role") {
    const auto role = role_of(value<std::string>(key, node, kRoleRange));
    if (!role) fail(node, "role: " + std::string(kRoleRange));
    traits.role = *role;
  } else if (key == "priority") {
    const auto number = value<std::int64_t>(key, node, kPriorityRange);
    if (number < 0 || number > kMaxPriority) fail(node, "priority: " + std::string(kPriorityRange));
    traits.priority = static_cast<int>(number);
  } else if (key == "metered" || key == "trusted") {
    (key == "metered" ? traits.metered : traits.trusted) =
        value<bool>(key, node, "give true or false");
  } else if (key == "rate_cap_mbit") {
    const auto mbit = node.value<double>();
    traits.rate_cap = mbit ? rate_of_text(toml_reader::number_text(*mbit) + "mbit") : std::nullopt;
    if (!traits.rate_cap) fail(node, "rate_cap_mbit: give a number above 0");
  } else {
    fail(node, "unknown key '" + key + "' of [[link]]" +
                   did_you_mean(key, {"nic", "peer", "role", "priority", "metered", "rate_cap_mbit",
                                      "trusted"}));
  }
}

}  // namespace

std::string link_table_text(const toml::table& table, const std::string& file) {
  return LinkTable(table, file).text();
}

}  // namespace interneuron::settings
