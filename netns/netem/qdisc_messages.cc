#include "netns/netem/qdisc_messages.h"

#include <linux/pkt_sched.h>
#include <linux/rtnetlink.h>
#include <netlink/msg.h>
#include <netlink/netlink.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "netns/state/error.h"

namespace interneuron::netns::qdisc {

namespace {

constexpr std::uint32_t first_class(std::uint32_t major) { return handle(major) | 1U; }
constexpr std::uint64_t kMost32 = std::numeric_limits<std::uint32_t>::max();

// Bytes.
constexpr int kEthernetHeader = 14;
// The rate of netem 1:, in bytes per second: 1 ns for 1000 bytes. It delays nothing and only makes
// netem keep the order.
constexpr std::uint64_t kOrderingRate = 1'000'000'000'000;
// The rate of tbf 6:, in bytes per second: 120 ns for the largest packet, less than the kernel
// needs to send one, so that it never delays.
constexpr std::uint64_t kSegmenterRate = 12'500'000'000;
// IP bytes: the MTU that wire() gives to NICs.
constexpr std::uint32_t kLargestPacket = 1500;
// The shaper's burst, as time at its rate. A late timer makes the shaper late; it catches up as
// much as this, and after a pause it sends this much at once.
constexpr Duration kBurst = std::chrono::milliseconds(1);
// The unit of time in which htb is told its burst: PSCHED_SHIFT of net/pkt_sched.h.
constexpr Duration kTick{64};
// The version of htb's netlink interface: HTB_VER of sch_htb.c.
constexpr std::uint32_t kHtbVersion = 3;

std::uint32_t fraction(double probability) {
  return static_cast<std::uint32_t>(
      std::lround(std::clamp(probability, 0.0, 1.0) * static_cast<double>(kMost32)));
}

[[noreturn]] void out_of_memory() { throw TestbedError(1, "out of memory"); }

// A netlink request about one qdisc or class, built attribute by attribute and sent once. Owns its
// message.
class Request {
 public:
  struct Place {
    int nic;
    std::uint32_t own;
    std::uint32_t parent;
  };
  Request(int type, int flags, Place place, const char* kind)
      : message_(nlmsg_alloc_simple(type, flags)) {
    if (message_ == nullptr) out_of_memory();
    tcmsg header{};
    header.tcm_family = AF_UNSPEC;
    header.tcm_ifindex = place.nic;
    header.tcm_handle = place.own;
    header.tcm_parent = place.parent;
    append(header);
    if (kind != nullptr && nla_put_string(message_, TCA_KIND, kind) != 0) out_of_memory();
  }
  ~Request() {
    if (message_ != nullptr) nlmsg_free(message_);
  }
  Request(const Request&) = delete;
  Request& operator=(const Request&) = delete;

  // Takes a copy, because libnl accepts no pointer to const.
  template <class T>
  void append(T structure) {
    if (nlmsg_append(message_, &structure, sizeof structure, NLMSG_ALIGNTO) != 0) out_of_memory();
  }
  template <class T>
  void put(int attribute, const T& value) {
    if (nla_put(message_, attribute, sizeof value, &value) != 0) out_of_memory();
  }
  nlattr* open(int attribute) {
    nlattr* out = nla_nest_start(message_, attribute);
    if (out == nullptr) out_of_memory();
    return out;
  }
  void close(nlattr* nest) { nla_nest_end(message_, nest); }

  // Sends the request and returns the kernel's answer.
  int send(nl_sock* socket) { return nl_send_sync(socket, std::exchange(message_, nullptr)); }

 private:
  nl_msg* message_;
};

void put_header_allowance(Request& request) {
  tc_sizespec size{};
  size.overhead = -kEthernetHeader;
  nlattr* nest = request.open(TCA_STAB);
  request.put(TCA_STAB_BASE, size);
  request.close(nest);
}

void put_bursts(Request& request, const Bursts& bursts) {
  const tc_netem_gemodel chain{bursts.to_bad, bursts.to_good, bursts.kept_in_bad,
                               bursts.lost_in_good};
  nlattr* nest = request.open(TCA_NETEM_LOSS);
  request.put(NETEM_LOSS_GE, chain);
  request.close(nest);
}

int send_segmenter(nl_sock* socket, int nic) {
  Request request(RTM_NEWQDISC, NLM_F_CREATE | NLM_F_EXCL, {nic, handle(kSegmenter), TC_H_ROOT},
                  "tbf");
  put_header_allowance(request);
  tc_tbf_qopt basic{};
  // Without a link layer the kernel would ask for a rate table.
  basic.rate.linklayer = TC_LINKLAYER_ETHERNET;
  basic.rate.rate = static_cast<std::uint32_t>(kMost32);
  // The limit of tbf's first queue, which netem 1: replaces.
  basic.limit = kLargestPacket;
  nlattr* options = request.open(TCA_OPTIONS);
  request.put(TCA_TBF_PARMS, basic);
  request.put(TCA_TBF_RATE64, kSegmenterRate);
  request.put(TCA_TBF_BURST, kLargestPacket);
  request.close(options);
  return request.send(socket);
}

int send_shaper(nl_sock* socket, int nic, const Settings& settings) {
  const std::uint32_t parent = first_class(settings.layered ? kBursts : kMain);
  Request request(RTM_NEWQDISC, NLM_F_CREATE | NLM_F_EXCL, {nic, handle(kShaper), parent}, "htb");
  tc_htb_glob global{};
  global.version = kHtbVersion;
  // The default of the program tc; without effect where there is one class.
  global.rate2quantum = 10;
  // All packets belong to class 3:1.
  global.defcls = 1;
  nlattr* options = request.open(TCA_OPTIONS);
  request.put(TCA_HTB_INIT, global);
  request.close(options);
  return request.send(socket);
}

Main main_settings(const emu::Conditions& conditions) {
  Main out;
  const auto delay = std::chrono::round<std::chrono::microseconds>(conditions.one_way);
  out.latency_ns = Duration(std::max(delay, std::chrono::microseconds{})).count();
  out.loss = conditions.rate.bits_per_second > 0 ? fraction(conditions.loss) : fraction(1);
  out.duplicate = fraction(conditions.duplicate);
  out.corrupt = fraction(conditions.corrupt);
  out.reorder = fraction(conditions.reorder);
  return out;
}

// A fifo has one limit: that in packets where packets of the largest size reach it first, else that
// in bytes.
Queue queue_of(const emu::Conditions& conditions) {
  const std::uint64_t packets = conditions.queue_packets;
  const bool in_packets = packets > 0 && packets <= conditions.queue_bytes / kLargestPacket;
  // One packet of the largest size always fits, since an idle bottleneck accepts any packet.
  const std::uint64_t bytes = std::max<std::uint64_t>(conditions.queue_bytes, kLargestPacket);
  return {in_packets, static_cast<std::uint32_t>(std::min(in_packets ? packets : bytes, kMost32))};
}

}  // namespace

Settings settings_of(const emu::Conditions& conditions) {
  Settings out;
  out.main = main_settings(conditions);
  if (const auto& chain = conditions.gilbert_elliott) {
    out.layered = out.main.duplicate == 0;
    // A netem takes either a chain or an independent loss. Where there is one netem only, the chain
    // gets both: `kept` is the probability to survive the independent loss.
    const bool all_lost = out.main.loss == fraction(1);
    const double kept = out.layered ? 1 : all_lost ? 0 : 1 - conditions.loss;
    out.bursts = {fraction(chain->p), fraction(chain->r), fraction((1 - chain->loss_in_bad) * kept),
                  fraction(1 - (1 - chain->loss_in_good) * kept)};
  }
  const std::int64_t rate = conditions.rate.bits_per_second;
  out.bytes_per_second =
      rate > 0 ? std::max<std::uint64_t>(1, static_cast<std::uint64_t>(rate) / 8) : 0;
  out.queue = queue_of(conditions);
  return out;
}

int send_main(nl_sock* socket, int nic, int flags, const Settings& settings) {
  const Main& main = settings.main;
  Request request(RTM_NEWQDISC, flags, {nic, handle(kMain), first_class(kSegmenter)}, "netem");
  tc_netem_qopt basic{};
  basic.limit = kDelayLinePackets;
  basic.loss = main.loss;
  basic.duplicate = main.duplicate;
  // With 0 netem reorders nothing, with 1 any packet may be reordered.
  basic.gap = main.reorder > 0 ? 1 : 0;
  nlattr* options = request.open(TCA_OPTIONS);
  request.append(basic);
  request.put(TCA_NETEM_LATENCY64, main.latency_ns);
  request.put(TCA_NETEM_CORR, tc_netem_corr{});
  request.put(TCA_NETEM_REORDER, tc_netem_reorder{main.reorder, 0});
  request.put(TCA_NETEM_CORRUPT, tc_netem_corrupt{main.corrupt, 0});
  tc_netem_rate rate{};
  rate.rate = static_cast<std::uint32_t>(kMost32);
  request.put(TCA_NETEM_RATE, rate);
  request.put(TCA_NETEM_RATE64, kOrderingRate);
  if (settings.bursts && !settings.layered) put_bursts(request, *settings.bursts);
  request.close(options);
  return request.send(socket);
}

int send_bursts(nl_sock* socket, int nic, int flags, const Bursts& bursts) {
  Request request(RTM_NEWQDISC, flags, {nic, handle(kBursts), first_class(kMain)}, "netem");
  tc_netem_qopt basic{};
  basic.limit = kDelayLinePackets;
  nlattr* options = request.open(TCA_OPTIONS);
  request.append(basic);
  put_bursts(request, bursts);
  request.close(options);
  return request.send(socket);
}

int send_rate(nl_sock* socket, int nic, int flags, std::uint64_t bytes_per_second) {
  Request request(RTM_NEWTCLASS, flags, {nic, first_class(kShaper), handle(kShaper)}, "htb");
  tc_htb_opt basic{};
  // As in send_segmenter().
  basic.rate.linklayer = TC_LINKLAYER_ETHERNET;
  basic.rate.rate = static_cast<std::uint32_t>(std::min(bytes_per_second, kMost32));
  basic.ceil = basic.rate;
  basic.buffer = static_cast<std::uint32_t>(kBurst / kTick);
  basic.cbuffer = basic.buffer;
  basic.quantum = kLargestPacket;
  nlattr* options = request.open(TCA_OPTIONS);
  request.put(TCA_HTB_PARMS, basic);
  if (bytes_per_second > kMost32) {
    request.put(TCA_HTB_RATE64, bytes_per_second);
    request.put(TCA_HTB_CEIL64, bytes_per_second);
  }
  request.close(options);
  return request.send(socket);
}

int send_queue(nl_sock* socket, int nic, int flags, Queue queue) {
  const std::uint32_t own = handle(queue.in_packets ? kPacketQueue : kByteQueue);
  Request request(RTM_NEWQDISC, flags, {nic, own, first_class(kShaper)},
                  queue.in_packets ? "pfifo" : "bfifo");
  request.put(TCA_OPTIONS, tc_fifo_qopt{queue.limit});
  return request.send(socket);
}

int create(nl_sock* socket, int nic, const Settings& settings) {
  constexpr int kNew = NLM_F_CREATE | NLM_F_EXCL;
  int result = send_segmenter(socket, nic);
  if (result == 0) result = send_main(socket, nic, kNew, settings);
  if (result == 0 && settings.layered) result = send_bursts(socket, nic, kNew, *settings.bursts);
  if (result == 0) result = send_shaper(socket, nic, settings);
  // A rate of 0 is none that htb takes. Where nothing may pass, netem 1: loses everything, and the
  // shaper's rate does not matter.
  if (result == 0) {
    result = send_rate(socket, nic, kNew, std::max<std::uint64_t>(1, settings.bytes_per_second));
  }
  return result == 0 ? send_queue(socket, nic, kNew, settings.queue) : result;
}

int remove(nl_sock* socket, int nic) {
  return Request(RTM_DELQDISC, 0, {nic, 0, TC_H_ROOT}, nullptr).send(socket);
}

}  // namespace interneuron::netns::qdisc
