// The plain messages that have come from peers: which are handed to the application.
#pragma once

#include <bitset>
#include <cstdint>
#include <map>
#include <optional>

#include "core/wire/plain_header.h"
#include "interneuron/units.h"

namespace interneuron::messages {

// Judges complete messages by their headers. Messages (src/core/messages/messages.h) owns one and
// feeds it every complete plain message.
//
// A message is delivered once, in the first variant that comes in time: the identifiers of each
// peer are remembered in a window of kWindow, and one that is older than that is not delivered. Of
// a channel where only the newest counts, a message that is older than one delivered is superseded;
// kMaxChannels channels of a peer are remembered, and the one that was delivered on longest ago
// makes room.
//
// Headers are a peer's bytes. One that jumps ahead in its identifiers loses messages of its own
// only. Memory: about 4 KB for each peer that sends plain messages, until forget(). Pure;
// thread-compatible; never throws but std::bad_alloc.
class ReceivedMessages {
 public:
  // Senders count per peer: what 1,000 messages a second are within four seconds.
  static constexpr std::uint32_t kWindow = 4096;
  // No measurement behind this value: it only has to be more than the channels of an application
  // on which only the newest message counts.
  static constexpr std::size_t kMaxChannels = 64;

  enum class Verdict : std::uint8_t {
    kDeliver,
    // Its deadline has passed.
    kLate,
    // Another variant of it was delivered.
    kRepeated,
    // It is so much older than another one that nobody knows whether it was.
    kTooOld,
    // A newer message of its channel was delivered.
    kSuperseded,
  };
  // `age`: from t0 until now; nothing where the sender's clock is not known, then the message is
  // taken to be in time.
  Verdict judge(PeerId peer, const wire::PlainHeader& header, std::optional<Duration> age);

  // The peer has begun a new life or is gone.
  void forget(PeerId peer) { peers_.erase(peer); }

 private:
  struct Seen {
    // The largest identifier delivered, and which of those before it were: bit i stands for
    // largest - i.
    std::optional<std::uint32_t> largest;
    std::bitset<kWindow> delivered;
    // The newest message delivered of each channel, and when: a count of deliveries.
    struct Channel {
      std::uint32_t newest = 0;
      std::uint64_t used = 0;
    };
    std::map<std::uint16_t, Channel> channels;
    std::uint64_t deliveries = 0;

    // How far behind the largest identifier this one is.
    std::uint32_t back(std::uint32_t id) const;
    void deliver(const wire::PlainHeader& header);
  };
  std::map<PeerId, Seen> peers_;
};

}  // namespace interneuron::messages
