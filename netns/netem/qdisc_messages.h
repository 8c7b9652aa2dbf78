// Builds and sends the netlink requests that make and change the qdiscs of a NIC (their tree is in
// qdisc.h). Keeps no state; thread-compatible with its socket. Errors: functions return libnl's
// codes (0: done) and throw TestbedError when memory runs out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "lab/emu/conditions.h"

struct nl_sock;

namespace interneuron::netns::qdisc {

// Major numbers of the qdiscs: netem 1:, netem 2: (bursts), htb 3:, bfifo 4:, pfifo 5:, tbf 6:. The
// two fifos have different numbers because a qdisc cannot change its kind.
constexpr std::uint32_t handle(std::uint32_t major) { return major << 16U; }
inline constexpr std::uint32_t kMain = 1;
inline constexpr std::uint32_t kBursts = 2;
inline constexpr std::uint32_t kShaper = 3;
inline constexpr std::uint32_t kByteQueue = 4;
inline constexpr std::uint32_t kPacketQueue = 5;
inline constexpr std::uint32_t kSegmenter = 6;

// The most packets that a netem delays at a time: one second of 1.1 Gbit/s in packets of 1400
// bytes, or of 100 Mbit/s in packets of 125. It bounds what a flood takes of the kernel's memory
// to some 250 MB.
inline constexpr std::uint32_t kDelayLinePackets = 100'000;

// Settings of netem 1:, in the kernel's units: probabilities are fractions of 2^32 - 1.
struct Main {
  // A whole number of microseconds, so that smaller changes of the delay need no request.
  std::int64_t latency_ns = 0;
  std::uint32_t loss = 0;
  std::uint32_t duplicate = 0;
  std::uint32_t corrupt = 0;
  std::uint32_t reorder = 0;
  bool operator==(const Main&) const = default;
};

// A Gilbert-Elliott chain as the kernel takes it: the probabilities to change state, to keep a
// packet in the bad state, and to lose one in the good state.
struct Bursts {
  std::uint32_t to_bad = 0;
  std::uint32_t to_good = 0;
  std::uint32_t kept_in_bad = 0;
  std::uint32_t lost_in_good = 0;
  bool operator==(const Bursts&) const = default;
};

// The fifo behind the shaper: its limit in packets or in bytes.
struct Queue {
  bool in_packets = false;
  std::uint32_t limit = 0;
  bool operator==(const Queue&) const = default;
};

// Everything that the tree of one NIC is set to.
struct Settings {
  Main main;
  std::optional<Bursts> bursts;
  // Whether the bursts have a netem of their own. They have not where packets are duplicated:
  // kernels from 6.1.142 to 6.18 refuse a second netem below one that duplicates. The chain then
  // belongs to netem 1: and falls back into its good state with each change.
  bool layered = false;
  // 0: nothing passes.
  std::uint64_t bytes_per_second = 0;
  Queue queue;
};

Settings settings_of(const emu::Conditions& conditions);

// Each makes (`flags` NLM_F_CREATE | NLM_F_EXCL) or changes (0) one qdisc of the tree. Every
// request names all settings: of those left out the kernel forgets some (loss, size table) and
// keeps others (rate).
int send_main(nl_sock* socket, int nic, int flags, const Settings& settings);
int send_bursts(nl_sock* socket, int nic, int flags, const Bursts& bursts);
int send_rate(nl_sock* socket, int nic, int flags, std::uint64_t bytes_per_second);
// To change the kind of fifo `flags` are NLM_F_CREATE | NLM_F_REPLACE; the packets that wait are
// then lost.
int send_queue(nl_sock* socket, int nic, int flags, Queue queue);
// Makes the whole tree at a NIC that has no root qdisc.
int create(nl_sock* socket, int nic, const Settings& settings);
// Removes the root qdisc, whatever it is, with all below it.
int remove(nl_sock* socket, int nic);

}  // namespace interneuron::netns::qdisc
