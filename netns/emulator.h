// The user-space link emulator: takes frames from one NIC of a pair, passes them through a
// LinkModel in real time and sends them on from the other, for both directions of every link.
//
// Delay counts from the kernel's time of arrival, so that waking late costs nothing on the way in.
// On the way out it sleeps until shortly before the next frame is due and then spins (see kSpin).
// Carried are IPv4 and ARP; the first IPv4 packet on any link is the epoch of all.
//
// Thread-compatible; run() takes the thread. Errors: the constructor throws TestbedError (1);
// afterwards none.
#pragma once

#include <sys/uio.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emu/link.h"
#include "netns/frame_port.h"
#include "netns/frame_store.h"
#include "netns/shared_stats.h"

namespace interneuron::netns {

class Emulator {
 public:
  // `stats` outlives the emulator. The NICs are those that wire() makes; the current namespace is
  // the middle one.
  Emulator(const std::vector<LinkSpec>& links, std::uint64_t seed, SharedStats& stats);

  // Until `stop_fd` becomes readable.
  void run(int stop_fd);

 private:
  struct Link {
    Link(const LinkSpec& spec, std::uint64_t seed);
    FramePort vehicle;
    FramePort road;
    emu::Link model;
  };
  struct Direction {
    FramePort* from;
    FramePort* to;
    emu::LinkModel* model;
    SharedDirection* shared;
    TimePoint last_arrival{};
    FrameStore store{};
  };

  std::size_t take_in(Direction& direction, Duration realtime_offset);
  void enter(Direction& direction, const FramePort::Frame& frame, TimePoint arrival);
  std::size_t send_due(Direction& direction);
  void count_lateness(Duration lateness);
  std::optional<TimePoint> next_due() const;
  void rest();
  void keep_house();

  std::vector<std::unique_ptr<Link>> links_;
  std::vector<Direction> directions_;
  std::array<iovec, FramePort::kBatch> batch_{};
  SharedStats& stats_;
  std::optional<TimePoint> epoch_;
  TimePoint next_housekeeping_{};
  TimePoint last_sent_{};
  int stop_fd_ = -1;
  bool stopped_ = false;
};

}  // namespace interneuron::netns
