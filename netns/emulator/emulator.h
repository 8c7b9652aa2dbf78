// The user-space link emulator: receives frames at one NIC of a link, delays or drops them as an
// emu::LinkModel says, in real time, and sends them out of the other, for both directions of every
// link of a testbed.
//
// A frame's delay counts from the kernel's time of arrival, so that waking up late costs nothing on
// the way in. On the way out the emulator sleeps until shortly before the next frame is due and
// then spins (kSpin of emulator.cc); dense traffic is sent in groups (kGroup).
//
// A frame of a link that shares a cell passes that cell behind its model, where it may get a mark
// of ECN; the counters of links do not hold what cells drop.
//
// Only IPv4 and IPv6 pass through the model; the first such packet on any link is the epoch of all.
// ARP, neighbour discovery and multicast of link scope never cross the air behind a real modem:
// they are passed on at once and not counted. All other frames are dropped.
//
// Frames are untrusted bytes from the programs in the testbed: headers are read only within the
// frame's length. A flood costs its sender frames: the kernel's ring drops what does not fit, the
// models' queues are bounded, and frames that are due are sent after at most kTakeInAtOnce
// arrivals.
//
// Thread-compatible; run() takes the thread. Errors: the constructor throws TestbedError (1); run()
// throws none, and counts frames that the kernel refuses.
#pragma once

#include <poll.h>
#include <sys/uio.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "lab/emu/cell.h"
#include "lab/emu/link_model.h"
#include "netns/emulator/frames.h"
#include "netns/state/bearers.h"
#include "netns/state/shared_stats.h"

namespace interneuron::netns {

class Emulator {
 public:
  // `bearers` outlives the emulator. The NICs are those that wire() makes; the current namespace is
  // Namespaces::air.
  Emulator(const State& state, Bearers& bearers);

  // Carries frames until `stop_fd` becomes readable.
  void run(int stop_fd);

 private:
  // Direction 2i is up of link i, 2i + 1 is down. A frame that comes in at NIC k of the hub enters
  // direction k and leaves at NIC `to`.
  struct Direction {
    std::size_t to;
    emu::LinkModel* model;
    SharedDirection* shared;
    // What its frames pass behind the model; nullptr: nothing.
    emu::Cell* cell;
    TimePoint last_arrival{};
  };

  std::size_t take_in(Duration realtime_offset);
  void enter(Direction& direction, const FrameHub::Frame& frame, TimePoint arrival);
  std::size_t send_due(std::size_t index);
  void enter_cell(std::size_t direction, const emu::LinkModel::Packet& packet);
  std::size_t send_from_cells();
  void count_lateness(Duration lateness);
  std::optional<TimePoint> next_due() const;
  void rest();
  void sleep_until(TimePoint wake, bool or_frame);
  void tick(TimePoint present);

  Bearers& bearers_;
  SharedStats& stats_;
  FrameHub hub_;
  std::vector<Direction> directions_;
  // The time that each of the bearers' cells has been told of: it never goes back.
  std::vector<Duration> cell_times_;
  FrameStore store_;
  std::array<iovec, FrameHub::kBatch> batch_{};
  // Frames of the batch that may be released once it has been sent.
  std::vector<FrameStore::Handle> sent_;
  // Readable when a frame has come, when the bearers want attention, when it is time to stop.
  std::array<pollfd, 3> fds_{};
  TimePoint next_tick_{};
  TimePoint next_housekeeping_{};
  TimePoint last_work_{};
  bool stopped_ = false;
};

}  // namespace interneuron::netns
