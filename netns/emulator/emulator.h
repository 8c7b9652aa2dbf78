// The user-space link emulator: takes frames from one NIC of a pair, passes them through a
// LinkModel in real time and sends them on from the other, for both directions of every link.
//
// Delay counts from the kernel's time of arrival, so that waking late costs nothing on the way in.
// On the way out it sleeps until shortly before the next frame is due and then spins (kSpin); dense
// traffic it carries in groups (kGroup).
// Carried are IPv4 and IPv6; the first such packet on any link is the epoch of all. What belongs to
// the link itself (ARP, neighbour discovery, multicast of link scope) never crosses the air behind
// a real modem and is passed on at once, uncounted.
//
// Thread-compatible; run() takes the thread. Errors: the constructor throws TestbedError (1);
// afterwards none.
#pragma once

#include <poll.h>
#include <sys/uio.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "lab/emu/link_model.h"
#include "netns/emulator/frame_hub.h"
#include "netns/emulator/frame_store.h"
#include "netns/state/bearers.h"
#include "netns/state/shared_stats.h"

namespace interneuron::netns {

class Emulator {
 public:
  // `bearers` outlives the emulator. The NICs are those that wire() makes; the current namespace is
  // Namespaces::air.
  Emulator(const State& state, Bearers& bearers);

  // Until `stop_fd` becomes readable.
  void run(int stop_fd);

 private:
  // Direction 2i is up of link i, 2i + 1 down; a frame of NIC k of the hub enters direction k.
  struct Direction {
    std::size_t to;  // NIC of the hub
    emu::LinkModel* model;
    SharedDirection* shared;
    TimePoint last_arrival{};
  };

  std::size_t take_in(Duration realtime_offset);
  void enter(Direction& direction, const FrameHub::Frame& frame, TimePoint arrival);
  std::size_t send_due(Direction& direction);
  void count_lateness(Duration lateness);
  std::optional<TimePoint> next_due() const;
  void rest();
  void sleep_until(TimePoint wake, bool or_frame);
  void tick(TimePoint present);

  Bearers& bearers_;
  SharedStats& stats_;
  FrameHub hub_;
  std::vector<Direction> directions_;
  FrameStore store_;
  std::array<iovec, FrameHub::kBatch> batch_{};
  std::vector<FrameStore::Handle> sent_;  // to be released after the batch
  std::array<pollfd, 3> fds_{};           // frames, attention, stop
  TimePoint next_tick_{};
  TimePoint next_housekeeping_{};
  TimePoint last_work_{};
  bool stopped_ = false;
};

}  // namespace interneuron::netns
