// What a path has sent of the train whose dispersion the peer reports.
#pragma once

#include <cstdint>
#include <optional>

#include "core/flow/packet_log.h"
#include "core/link/rate_estimator.h"
#include "core/wire/packet.h"

namespace interneuron::flow {

// The receiver of a train knows how far apart its packets came, but not whether a pause was the
// link's or the sender's own: this adds how fast the train left, and the longest time in which
// nothing was there to be sent. SentPackets owns one and asks it with each report, after the
// report's arrivals are noted. Follows the newest train that the peer has told of, whose packets'
// records may be gone meanwhile; each packet is looked at once. A train has no more packets than
// left since its first, whatever the peer says. Constant memory. Pure; thread-compatible.
class SentTrain {
 public:
  // The report's train; nothing when it has none, or when its packets are forgotten already.
  std::optional<link::Train> told(const PacketLog& log, const wire::LinkReport& report);

 private:
  void follow(const PacketLog& log, std::uint64_t last);

  // Its first packet: its number, when it left, and its train_bytes.
  std::uint64_t number_ = 0;
  TimePoint at_{};
  std::uint32_t from_ = 0;
  // The packets up to this one were looked at; how many of them are data-sized, and what counts
  // of the last of these.
  std::uint64_t seen_ = 0;
  std::uint32_t left_ = 1;
  TimePoint last_at_{};
  bool last_waited_ = false;
  bool last_is_probe_ = false;
  Duration pause_{};
};

}  // namespace interneuron::flow
