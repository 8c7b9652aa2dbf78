#include "app/watch/row.h"

#include <algorithm>

namespace interneuron::watch {

std::vector<LinkRow> join(const std::vector<NicFacts>& nics, const std::vector<LiveLinks>& live) {
  std::vector<LinkRow> rows;
  for (const NicFacts& facts : nics) {
    const std::size_t before = rows.size();
    for (const LiveLinks& program : live) {
      for (const LiveLinks::Link& link : program.links) {
        if (link.nic == facts.nic.name) rows.push_back({facts, link.measured});
      }
    }
    if (rows.size() == before) rows.push_back({facts, std::nullopt});
  }
  return rows;
}

bool is_of_interest(const LinkRow& row) {
  return row.measured.has_value() || row.facts.nic.kind != "loopback";
}

std::string printable(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
  return text;
}

}  // namespace interneuron::watch
