// The packets of one train as they have arrived on a path, and the rate that they tell. Pure;
// thread-compatible; constant memory.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

#include "interneuron/units.h"

namespace interneuron::flow {

// PathReceiver (src/core/flow/arrivals.h) owns those of its path and says what belongs to one.
struct ReceivedTrain {
  // A pause of this or less never ends a train: uplinks of cellular networks are granted in bursts
  // of 1 to 10 ms (docs/constants.md, "Rate of a link").
  static constexpr Duration kTrainGap = std::chrono::milliseconds(10);
  // A pause longer than this many mean gaps of the train ends it. No measurement behind this value:
  // it only has to be larger than gaps differ that are not of the sender's making.
  static constexpr int kPauseGaps = 4;
  // Grants are at most so far apart: a longer gap is a stall of the radio (docs/constants.md, "Rate
  // of a link").
  static constexpr Duration kLongestUngranted = std::chrono::milliseconds(25);

  // A grant brings so many packets at least: over a slow link each packet takes as long by itself
  // (docs/constants.md, "Rate of a link").
  static constexpr int kGrantPackets = 2;

  // The number of its first packet, and how many packets it has had.
  std::uint64_t start = 0;
  std::uint32_t packets = 0;
  // The size of all packets but the first, IP headers included.
  std::size_t bytes = 0;
  TimePoint first{};
  TimePoint last{};
  Duration longest_gap{};
  // The most that a byte of any packet after the first took to arrive.
  double most_ns_per_byte = 0;
  bool closed = false;
  // The gaps that are of the link's making, together, and how many they are; and how long the train
  // took to leave.
  Duration ungranted{};
  std::uint32_t grants = 0;
  Duration sent{};
  // Where the first and the last of those gaps begin: when a packet came last and the bytes until
  // then.
  struct Mark {
    TimePoint at{};
    std::size_t bytes = 0;
  } first_end{}, last_end{};
  Duration longest_ungranted{};
  // The number that came last, and the newest packets that came evenly: how many, their bytes, how
  // long they took, and how long they would have taken as fast as they left.
  std::uint64_t newest = 0;
  struct Steady {
    std::uint32_t packets = 0;
    std::size_t bytes = 0;
    Duration took{};
    Duration sent{};
  } steady{};

  void begin(TimePoint now, std::uint64_t number);
  // `apart`: the packet left so long after the one that came before; `pause`: for so long it was
  // not the link that held it up.
  void add(TimePoint now, std::uint64_t number, std::size_t ip_bytes, Duration apart,
           Duration pause);
  DataRate rate() const;
  Duration mean_gap() const { return packets > 1 ? (last - first) / (packets - 1) : Duration{}; }
  // Whether a packet that comes now, after a pause of the sender, begins another train.
  bool ends(TimePoint now, Duration pause) const;
  // Whether grants came regularly from the end of the first one to that of the last one but what
  // comes now, and brought enough of it to tell the rate by.
  bool spans_grants() const {
    return grants > 1 && mean_ungranted() >= kGrantPackets * mean_gap() &&
           4 * longest_ungranted <= 5 * mean_ungranted() &&
           3 * (last_end.bytes - first_end.bytes) >= bytes;
  }
  // The mean of the gaps that are of the link's making.
  Duration mean_ungranted() const { return grants > 0 ? ungranted / grants : Duration::zero(); }
  // Whether it tells a rate: no single gap makes up most of it.
  bool even() const;
  // The packet that came last is the last of its message.
  void message_ends();

 private:
  void add_steady(std::uint64_t number, std::size_t ip_bytes, Duration gap, Duration apart);
  DataRate mean_rate() const;
};

}  // namespace interneuron::flow
