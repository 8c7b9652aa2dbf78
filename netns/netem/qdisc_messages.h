// The requests by which the kernel learns what a NIC's qdiscs are to do, see qdisc.h for their
// tree. Errors: libnl's codes (0: done), TestbedError when out of memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "lab/emu/conditions.h"

struct nl_sock;

namespace interneuron::netns::qdisc {

// Handles: tbf 6:, netem 1:, netem 2:, htb 3:, bfifo 4: or pfifo 5: (a qdisc cannot change its
// kind).
constexpr std::uint32_t handle(std::uint32_t major) { return major << 16U; }
inline constexpr std::uint32_t kMain = 1;
inline constexpr std::uint32_t kBursts = 2;
inline constexpr std::uint32_t kShaper = 3;
inline constexpr std::uint32_t kByteQueue = 4;
inline constexpr std::uint32_t kPacketQueue = 5;
inline constexpr std::uint32_t kSegmenter = 6;

// Most packets that a netem holds: one second of 1.1 Gbit/s in packets of 1400 bytes, or of
// 100 Mbit/s in packets of 125. A flood finds its end here, at some 250 MB of the kernel's.
inline constexpr std::uint32_t kDelayLinePackets = 100'000;

// What each qdisc is told, in the kernel's units: probabilities are fractions of 2^32 - 1.
struct Main {
  std::int64_t latency_ns = 0;  // whole microseconds
  std::uint32_t loss = 0;
  std::uint32_t duplicate = 0;
  std::uint32_t corrupt = 0;
  std::uint32_t reorder = 0;
  bool operator==(const Main&) const = default;
};

struct Bursts {
  std::uint32_t to_bad = 0;
  std::uint32_t to_good = 0;
  std::uint32_t kept_in_bad = 0;
  std::uint32_t lost_in_good = 0;
  bool operator==(const Bursts&) const = default;
};

struct Queue {
  bool in_packets = false;
  std::uint32_t limit = 0;
  bool operator==(const Queue&) const = default;
};

struct Settings {
  Main main;
  std::optional<Bursts> bursts;
  // The bursts have a netem of their own. Not where packets are duplicated: kernels from 6.1.142 to
  // 6.18 refuse a second netem beside one that does, so the bursts are then the main netem's and
  // end with each change.
  bool layered = false;
  std::uint64_t bytes_per_second = 0;  // 0: nothing passes
  Queue queue;
};

Settings settings_of(const emu::Conditions& conditions);

// `flags`: NLM_F_CREATE | NLM_F_EXCL, or 0 to change. Each repeats everything, because the kernel
// forgets what is not named (loss, size table) or keeps it (rate), as it likes.
int send_main(nl_sock* socket, int nic, int flags, const Settings& settings);
int send_bursts(nl_sock* socket, int nic, int flags, const Bursts& bursts);
int send_rate(nl_sock* socket, int nic, int flags, std::uint64_t bytes_per_second);
// With NLM_F_CREATE | NLM_F_REPLACE where the kind is another; what waits is then lost.
int send_queue(nl_sock* socket, int nic, int flags, Queue queue);
// The whole tree, where there is none.
int create(nl_sock* socket, int nic, const Settings& settings);
// Whatever the root is.
int remove(nl_sock* socket, int nic);

}  // namespace interneuron::netns::qdisc
