// The fates of all messages of a run, and the figures that follow from them.
//
// begin() is told of every message when it is handed over, arrived() of every one that the receiver
// got. Memory: some 40 bytes per message of the run. Errors: numbers come from begin(), so a wrong
// one is a bug and is asserted. Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "interneuron/units.h"

namespace interneuron::load {

class Meter {
 public:
  // `variant_bytes` are the sizes of the variants from the whole message on.
  Meter(std::size_t vehicles, Duration deadline, std::vector<std::size_t> variant_bytes);

  // A vehicle hands a message over; its number counts from 0 within the vehicle.
  std::uint32_t begin(std::size_t vehicle, Duration now);
  // The first variant that arrives counts.
  void arrived(std::size_t vehicle, std::uint32_t number, std::size_t variant, Duration now);

  struct Message {
    Duration begun{};
    std::optional<Duration> arrived{};
    std::size_t variant = 0;
  };
  const std::vector<Message>& messages(std::size_t vehicle) const { return fates_[vehicle]; }
  std::size_t vehicles() const { return fates_.size(); }
  bool on_time(const Message& message) const;
  // The bytes of messages that arrived on time, of one vehicle and of all.
  std::size_t on_time_bytes(std::size_t vehicle) const;
  std::size_t on_time_bytes() const;
  // As above, but only messages that arrived within (from, to] count.
  std::size_t on_time_bytes(std::size_t vehicle, Duration from, Duration to) const;
  std::size_t count() const;
  // Messages without any variant by their deadline.
  std::size_t missed() const;
  // Messages that arrived on time, but in a smaller variant.
  std::size_t degraded() const;
  // The q-th percentile of the ages at which messages arrived that were on time; 0: none was.
  Duration age(double q) const;
  // Jain's index (Jain, Chiu, Hawe 1984) of the vehicles' bytes on time over the time for which
  // each of them sends, by vehicle: 1 when all have the same rate, 1/n when one has all. 0 when
  // nobody has any.
  double jain(const std::vector<Duration>& spans) const;

 private:
  Duration deadline_;
  std::vector<std::size_t> variant_bytes_;
  // By vehicle and number.
  std::vector<std::vector<Message>> fates_;
};

}  // namespace interneuron::load
