#include "core/messages/books.h"

#include <algorithm>

namespace interneuron::messages {
namespace {

// How far `a` is ahead of `b`, negative if behind: identifiers wrap.
std::int32_t ahead(std::uint32_t a, std::uint32_t b) { return static_cast<std::int32_t>(a - b); }

}  // namespace

std::uint32_t ReceivedMessages::Seen::back(std::uint32_t id) const {
  return largest && ahead(id, *largest) <= 0 ? *largest - id : 0;
}

void ReceivedMessages::Seen::deliver(const wire::PlainHeader& header) {
  const std::int32_t forward = largest ? ahead(header.id, *largest) : 0;
  if (forward > 0) delivered <<= static_cast<std::uint32_t>(forward);
  if (!largest || forward > 0) largest = header.id;
  delivered.set(*largest - header.id);
  ++deliveries;
  if (!header.newest_only) return;
  if (channels.size() >= kMaxChannels && !channels.contains(header.channel)) {
    channels.erase(std::ranges::min_element(channels, {},
                                            [](const auto& entry) { return entry.second.used; }));
  }
  channels[header.channel] = {header.id, deliveries};
}

ReceivedMessages::Verdict ReceivedMessages::judge(PeerId peer, const wire::PlainHeader& header,
                                                  std::optional<Duration> age) {
  if (age && *age > header.deadline()) return Verdict::kLate;
  Seen& seen = peers_[peer];
  const std::uint32_t back = seen.back(header.id);
  if (back >= kWindow) return Verdict::kTooOld;
  if (seen.largest && ahead(header.id, *seen.largest) <= 0 && seen.delivered.test(back)) {
    return Verdict::kRepeated;
  }
  if (header.newest_only) {
    const auto channel = seen.channels.find(header.channel);
    if (channel != seen.channels.end() && ahead(channel->second.newest, header.id) > 0) {
      return Verdict::kSuperseded;
    }
  }
  seen.deliver(header);
  return Verdict::kDeliver;
}

}  // namespace interneuron::messages
