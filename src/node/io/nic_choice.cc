#include "node/io/nic_choice.h"

#include <fnmatch.h>

#include <algorithm>
#include <cctype>

namespace interneuron::io {

namespace {

constexpr std::string_view kKind = "kind:";
constexpr std::string_view kMac = "mac:";

bool same_letters(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, {}, [](unsigned char c) { return std::tolower(c); },
      [](unsigned char c) { return std::tolower(c); });
}

bool is_mac(std::string_view text) {
  // Six pairs of digits and five colons.
  constexpr std::size_t kChars = 17;
  if (text.size() != kChars) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (i % 3 == 2 ? c != ':' : std::isxdigit(c) == 0) return false;
  }
  return true;
}

}  // namespace

bool is_nic_rule(std::string_view pattern) {
  return pattern.starts_with(kKind) || pattern.starts_with(kMac) ||
         pattern.find_first_of("*?[") != std::string_view::npos;
}

std::string nic_pattern_error(std::string_view pattern) {
  const std::string quoted = "\"" + std::string(pattern) + "\"";
  if (pattern.empty()) return "an empty name of a network card";
  if (pattern == kKind) return quoted + " names no kind; say kind:wwan, for example";
  if (pattern.starts_with(kMac) && !is_mac(pattern.substr(kMac.size()))) {
    return quoted + " is no hardware address like mac:02:00:00:00:00:01";
  }
  return {};
}

bool matches(std::string_view pattern, const Nic& nic) {
  if (pattern.starts_with(kKind)) return same_letters(pattern.substr(kKind.size()), nic.kind);
  if (pattern.starts_with(kMac)) {
    return !nic.mac.empty() && same_letters(pattern.substr(kMac.size()), nic.mac);
  }
  if (!is_nic_rule(pattern)) return pattern == nic.name;
  return nic.kind != "loopback" &&
         ::fnmatch(std::string(pattern).c_str(), nic.name.c_str(), 0) == 0;
}

std::string no_match_text(std::string_view pattern, std::span<const Nic> nics) {
  const bool rule = is_nic_rule(pattern);
  std::string text = rule ? "no network card matches " : "no network card named ";
  text += pattern.empty() ? "\"\"" : pattern;
  std::string separator = "; there are ";
  for (const Nic& nic : nics) {
    text += separator + nic.name;
    if (pattern.starts_with(kMac)) {
      if (!nic.mac.empty()) text += " (" + nic.mac + ")";
    } else if (rule) {
      text += " (" + nic.kind + ")";
    }
    separator = ", ";
  }
  return text;
}

}  // namespace interneuron::io
