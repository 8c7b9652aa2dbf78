#include "node/io/nic.h"

#include <cerrno>

#include "node/io/netlink.h"
#include "node/io/nic_choice.h"
#include "node/io/nic_table.h"

namespace interneuron::io {

std::vector<Nic> list_nics() {
  const netlink::Socket requests = netlink::open_socket();
  NicTable table;
  table.read(requests.get(), true);
  table.refresh_lagging(requests.get());
  return table.nics();
}

std::optional<Nic> find_nic(std::string_view name) {
  for (Nic& nic : list_nics()) {
    if (nic.name == name) return std::move(nic);
  }
  return std::nullopt;
}

UnknownNic::UnknownNic(const std::string& what) : IoError(what, ENODEV) {}

std::string unknown_nic_text(std::string_view name) { return no_match_text(name, list_nics()); }

}  // namespace interneuron::io
