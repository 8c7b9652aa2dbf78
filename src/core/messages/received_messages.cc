#include "core/messages/books.h"

#include <algorithm>

namespace interneuron::messages {

std::uint32_t ReceivedMessages::Seen::back(std::uint32_t id) const {
  return largest && ahead(id, *largest) <= 0 ? *largest - id : 0;
}

void ReceivedMessages::Seen::deliver(const wire::PlainHeader& header) {
  const std::int32_t forward = largest ? ahead(header.id, *largest) : 0;
  if (forward > 0) delivered <<= static_cast<std::uint32_t>(forward);
  if (!largest || forward > 0) largest = header.id;
  delivered.set(*largest - header.id);
  if (header.only_after()) pass(header);
}

void ReceivedMessages::Seen::pass(const wire::PlainHeader& header) {
  ++deliveries;
  if (channels.size() >= kMaxChannels && !channels.contains(header.channel)) {
    channels.erase(std::ranges::min_element(channels, {},
                                            [](const auto& entry) { return entry.second.used; }));
  }
  channels[header.channel] = {header.id, deliveries};
}

ReceivedMessages::Verdict ReceivedMessages::look(PeerId peer, const wire::PlainHeader& header,
                                                 std::optional<Duration> age) const {
  if (age && *age > header.deadline()) return Verdict::kLate;
  const auto known = peers_.find(peer);
  if (known == peers_.end()) return Verdict::kDeliver;
  const Seen& seen = known->second;
  const std::uint32_t back = seen.back(header.id);
  if (back >= kWindow) return Verdict::kTooOld;
  if (seen.largest && ahead(header.id, *seen.largest) <= 0 && seen.delivered.test(back)) {
    return Verdict::kRepeated;
  }
  if (!header.only_after()) return Verdict::kDeliver;
  const auto channel = seen.channels.find(header.channel);
  const bool is_older =
      channel != seen.channels.end() && ahead(channel->second.newest, header.id) > 0;
  return is_older ? Verdict::kSuperseded : Verdict::kDeliver;
}

ReceivedMessages::Verdict ReceivedMessages::judge(PeerId peer, const wire::PlainHeader& header,
                                                  std::optional<Duration> age) {
  const Verdict verdict = look(peer, header, age);
  if (verdict == Verdict::kDeliver) peers_[peer].deliver(header);
  return verdict;
}

std::optional<std::uint32_t> ReceivedMessages::newest(PeerId peer, std::uint16_t channel) const {
  const auto known = peers_.find(peer);
  if (known == peers_.end()) return std::nullopt;
  const auto of = known->second.channels.find(channel);
  return of == known->second.channels.end() ? std::nullopt : std::optional(of->second.newest);
}

void ReceivedMessages::pass(PeerId peer, const wire::PlainHeader& header) {
  const auto known = newest(peer, header.channel);
  if (!known || ahead(header.id, *known) > 0) peers_[peer].pass(header);
}

}  // namespace interneuron::messages
