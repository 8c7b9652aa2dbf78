#include "netns/netem/qdisc.h"

#include <netlink/netlink.h>
#include <netlink/route/link.h>
#include <netlink/route/qdisc.h>
#include <netlink/route/tc.h>

#include <algorithm>
#include <utility>

#include "netns/netem/qdisc_messages.h"
#include "netns/state/error.h"

namespace interneuron::netns {

using netlink::check_nl;

struct TrafficControl::Nic {
  std::string name;
  int index = 0;
  qdisc::Settings settings;
  // The counters of trees that have been replaced since add().
  EgressCounters before;
};

TrafficControl::TrafficControl() : socket_(netlink::open_socket()) {}
TrafficControl::~TrafficControl() = default;
TrafficControl::TrafficControl(TrafficControl&&) noexcept = default;
TrafficControl& TrafficControl::operator=(TrafficControl&&) noexcept = default;

std::size_t TrafficControl::add(const std::string& nic, const emu::Conditions& conditions) {
  Nic added;
  added.name = nic;
  added.index = rtnl_link_get_ifindex(netlink::find_link(socket_.get(), nic).get());
  added.settings = qdisc::settings_of(conditions);
  // A root qdisc of another kind cannot be replaced, so it is removed first. An error only means
  // that there is none.
  qdisc::remove(socket_.get(), added.index);
  const int result = qdisc::create(socket_.get(), added.index, added.settings);
  if (result == -NLE_OBJ_NOTFOUND) {
    throw TestbedError(1,
                       "tc-netem is not in this kernel; --backend emulator does without it, or "
                       "scripts/vm.sh runs the command in a kernel that has it");
  }
  check_nl(result, "emulate a link on " + nic);
  nics_.push_back(std::move(added));
  return nics_.size() - 1;
}

std::size_t TrafficControl::change(std::size_t number, const emu::Conditions& conditions) {
  Nic& nic = nics_.at(number);
  const qdisc::Settings now = qdisc::settings_of(conditions);
  const std::string attempt = "change the link on " + nic.name;
  const qdisc::Settings before = nic.settings;
  nl_sock* socket = socket_.get();
  if (now.layered != before.layered) {
    nic.before = counters()[number];
    nic.before.lost = nic.before.packets_in - nic.before.packets_sent - nic.before.queue_drops;
    // An error only means that there is no tree, as after an attempt that failed halfway.
    qdisc::remove(socket, nic.index);
    check_nl(qdisc::create(socket, nic.index, now), attempt);
    nic.settings = now;
    return kMostRequests;
  }
  std::size_t requests = 0;
  const auto count = [&](int result) {
    check_nl(result, attempt);
    ++requests;
  };
  const bool bursts_differ = now.bursts != before.bursts;
  if (now.main != before.main || (bursts_differ && !now.layered)) {
    count(qdisc::send_main(socket, nic.index, 0, now));
  }
  if (bursts_differ && now.layered) count(qdisc::send_bursts(socket, nic.index, 0, *now.bursts));
  if (now.bytes_per_second != before.bytes_per_second && now.bytes_per_second > 0) {
    count(qdisc::send_rate(socket, nic.index, 0, now.bytes_per_second));
  }
  if (now.queue != before.queue) {
    const bool same_kind = now.queue.in_packets == before.queue.in_packets;
    count(qdisc::send_queue(socket, nic.index, same_kind ? 0 : NLM_F_CREATE | NLM_F_REPLACE,
                            now.queue));
  }
  // Only now, so that a change that has thrown above is tried again.
  nic.settings = now;
  return requests;
}

void TrafficControl::remove(std::size_t number) {
  const Nic& nic = nics_.at(number);
  check_nl(qdisc::remove(socket_.get(), nic.index), "remove the link from " + nic.name);
}

namespace {

// The counters of one NIC's tree. Those of netem 1: include the drops of the qdiscs below it.
struct KernelCounters {
  std::uint64_t packets = 0;
  std::uint64_t bytes = 0;
  std::uint64_t drops = 0;
  std::uint64_t waiting = 0;
  std::uint64_t waiting_bytes = 0;
  std::uint64_t queue_drops = 0;
};

void read_qdisc(rtnl_tc* qdisc, KernelCounters& out) {
  const std::uint32_t own = rtnl_tc_get_handle(qdisc);
  if (own == qdisc::handle(qdisc::kShaper)) {
    out.queue_drops = rtnl_tc_get_stat(qdisc, RTNL_TC_DROPS);
  }
  if (own != qdisc::handle(qdisc::kMain)) return;
  out.packets = rtnl_tc_get_stat(qdisc, RTNL_TC_PACKETS);
  out.bytes = rtnl_tc_get_stat(qdisc, RTNL_TC_BYTES);
  out.drops = rtnl_tc_get_stat(qdisc, RTNL_TC_DROPS);
  out.waiting = rtnl_tc_get_stat(qdisc, RTNL_TC_QLEN);
  out.waiting_bytes = rtnl_tc_get_stat(qdisc, RTNL_TC_BACKLOG);
}

// The counters of a NIC since add(): those of trees that have been replaced and of the present one.
EgressCounters total(const EgressCounters& before, const KernelCounters& now) {
  const std::uint64_t queue_drops = std::min(now.queue_drops, now.drops);
  const std::uint64_t seen = now.packets + now.waiting;
  // See EgressCounters::bytes_in.
  const std::uint64_t dropped_bytes =
      seen > 0 ? (now.bytes + now.waiting_bytes) / seen * now.drops : 0;
  EgressCounters out = before;
  out.packets_in += seen + now.drops;
  out.bytes_in += now.bytes + now.waiting_bytes + dropped_bytes;
  out.packets_sent += now.packets;
  out.bytes_sent += now.bytes;
  out.lost += now.drops - queue_drops;
  out.queue_drops += queue_drops;
  return out;
}

using Cache = std::unique_ptr<nl_cache, netlink::Deleter<nl_cache_free>>;

}  // namespace

std::vector<EgressCounters> TrafficControl::counters() {
  nl_cache* raw = nullptr;
  check_nl(rtnl_qdisc_alloc_cache(socket_.get(), &raw), "read the counters of netem");
  const Cache cache(raw);
  std::vector<KernelCounters> read(nics_.size());
  for (nl_object* o = nl_cache_get_first(raw); o != nullptr; o = nl_cache_get_next(o)) {
    auto* qdisc = reinterpret_cast<rtnl_tc*>(o);
    const int index = rtnl_tc_get_ifindex(qdisc);
    for (std::size_t i = 0; i < nics_.size(); ++i) {
      if (nics_[i].index == index) read_qdisc(qdisc, read[i]);
    }
  }
  std::vector<EgressCounters> out;
  for (std::size_t i = 0; i < nics_.size(); ++i) out.push_back(total(nics_[i].before, read[i]));
  return out;
}

bool kernel_has_netem() {
  const netlink::Socket socket = netlink::open_socket();
  const int lo = netlink::nic_index("lo");
  emu::Conditions all{.rate = DataRate::mbit(1)};
  all.gilbert_elliott.emplace();
  const int result = qdisc::create(socket.get(), lo, qdisc::settings_of(all));
  if (result == -NLE_EXIST) {
    throw TestbedError(1, "cannot try netem: `lo` has a qdisc; `tc qdisc del dev lo root`");
  }
  if (result == -NLE_PERM) check_nl(result, "try netem on lo");
  qdisc::remove(socket.get(), lo);
  return result == 0;
}

}  // namespace interneuron::netns
