// How a path that is new begins: low where others were met before its first message, and with
// nothing of its best while a queue is there that is not its own.
//
// A train that passes an empty cell says nothing of what fifty others are about to send. Those who
// begin at once and believe their trains fill the queue with their first frames, and see it a round
// trip and that queue later. So where anything of others was met, the first one to three messages
// are small, at random how many, so that those who begin together do not go up together; it is the
// slow start of TCP (RFC 5681) in terms of frames. Who met nobody begins as trains allow, so that a
// vehicle alone loses nothing.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/units.h"

namespace interneuron::cc {

// Owned and fed by the CrowdShare of the path. Whether others were met rests on the peer's word:
// one that lies gets small messages for two seconds at most. Constant memory. Pure;
// thread-compatible; never throws.
class Newcomer {
 public:
  // Something left.
  void sent(TimePoint now) {
    if (!sent_at_) sent_at_ = now;
  }
  // The peer has told of something that left.
  void told() { is_told_ = true; }
  // A train was told of so much later than it left, beyond the least round trip and what it takes
  // itself.
  void train_waited(Duration beyond);
  // A message is to be sent. `met`: others were met on the path; `part`: at random from 0 to less
  // than 1; `least_round_trip`: that of small packets, zero while it is not known. They count for
  // the first message alone.
  void asked(TimePoint now, bool met, double part, Duration least_round_trip);
  // Others were found: CrowdShare knows a share from now on, and the path counts as new no longer.
  void end() { is_over_ = true; }

  // Its first message came less than two seconds ago, or is still to come.
  bool is_new(TimePoint now) const;
  // It met others before its first message.
  bool begins_low() const { return begins_low_; }
  // The newest message is one of those at the beginning that are small.
  bool is_held_low() const { return small_ > 0; }

 private:
  // When the first packet left and the first message was asked for.
  std::optional<TimePoint> sent_at_;
  std::optional<TimePoint> began_at_;
  bool is_told_ = false;
  bool a_train_waited_ = false;
  bool is_over_ = false;
  bool begins_low_ = false;
  // How many messages, with the newest, are to be small.
  std::uint8_t small_ = 0;
};

}  // namespace interneuron::cc
