// Messages of the kernel's routing netlink: a row of them, each of a type and with a body of the
// input's choice, into the table of network cards and into all that reads routes and neighbours.
// Each message lies in memory of exactly its size, so that AddressSanitizer sees what reads beyond.
#include <linux/rtnetlink.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "interneuron/address.h"
#include "node/monitor/netlink_message.h"
#include "node/monitor/nic_table.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron;
using fuzz::require;

constexpr std::size_t kMostMessages = 16;
// Numbers of the cards that messages name most often.
constexpr int kCard = 2;

void read_all(io::NicTable& table, const nlmsghdr& message) {
  table.apply(message);
  table.apply_default_route(message);
  io::netlink::is_default_route(message);
  io::netlink::leads_through(message, kCard);
  io::netlink::card_of(message);
  if (const auto answer = io::netlink::route_answer(message, kCard)) {
    to_string(answer->gateway);
    to_string(answer->source);
  }
  if (const auto found = io::netlink::neighbour(message)) {
    require(!found->address.empty(), "a neighbour has no address");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::uint16_t kTypes[] = {RTM_NEWLINK,  RTM_DELLINK,  RTM_NEWADDR,  RTM_DELADDR,
                                      RTM_NEWROUTE, RTM_DELROUTE, RTM_NEWNEIGH, RTM_DELNEIGH};
  fuzz::Input input({data, size});
  io::NicTable table;
  for (std::size_t i = 0; i < kMostMessages && !input.empty(); ++i) {
    const std::uint16_t type = input.one_of(kTypes);
    const ByteView body = input.bytes(input.take<std::uint8_t>());
    const std::size_t length = sizeof(nlmsghdr) + body.size();
    const auto memory = std::make_unique<std::byte[]>(length);
    nlmsghdr header{};
    header.nlmsg_len = static_cast<std::uint32_t>(length);
    header.nlmsg_type = type;
    std::memcpy(memory.get(), &header, sizeof header);
    std::ranges::copy(body, memory.get() + sizeof header);
    read_all(table, *reinterpret_cast<const nlmsghdr*>(memory.get()));
    require(table.nics().size() <= kMostMessages, "a message made several cards");
    require(std::ranges::is_sorted(table.nics(), {}, &io::Nic::index), "the table is not sorted");
    for (const io::Nic& nic : table.nics()) {
      require(!nic.name.empty() && nic.addresses.size() <= kMostMessages, "a card is wrong");
    }
  }
  return 0;
}
