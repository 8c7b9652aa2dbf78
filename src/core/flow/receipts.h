// What became of a peer's messages here, as our feedback tells it.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>

#include "core/wire/packet.h"

namespace interneuron::flow {

// The messages that are complete and those that were refused. Each is told in kTellings packets of
// feedback, so that one lost packet does no harm; where more happen than feedback
// has room for, the oldest are not told, and the sender finds out by acknowledgements or its
// deadline. Peer (src/core/peers) owns one. A peer that sends many small messages, or pieces of
// many that are refused, only loses tellings of its own. Constant memory. Pure; thread-compatible.
class Receipts {
 public:
  // Feedback about all paths comes 5 ms after a packet at the latest
  // (src/core/peers/feedback_due.h), so that this is the time of three.
  static constexpr Duration kLeftOver = std::chrono::milliseconds(20);

  void complete(TimePoint now, MessageId message) {
    keep_few(complete_, wire::kMaxComplete);
    complete_.push_back({message, now, kTellings});
  }
  // This message, which is complete, was dropped: it was too late, or of a channel on which a newer
  // one was delivered.
  void mark_dropped(MessageId message) {
    const auto it = std::ranges::find(complete_, message, &Entry::message);
    if (it != complete_.end()) it->dropped = true;
  }
  void refuse(TimePoint now, MessageId message) {
    std::erase_if(refused_, [message](const Entry& entry) { return entry.message == message; });
    keep_few(refused_, wire::kMaxRefused);
    refused_.push_back({message, now, kTellings});
  }
  // Writes what is to be told into a feedback that leaves now. One that is not about all paths only
  // tells what is older than kLeftOver, because those about all paths have not come to it.
  void tell(TimePoint now, bool all_paths, wire::Feedback& feedback) {
    const auto waits = [now, all_paths](const Entry& entry) {
      return !all_paths && now - entry.at < kLeftOver;
    };
    for (Entry& entry : complete_) {
      if (waits(entry)) continue;
      const auto ago = std::chrono::floor<std::chrono::microseconds>(now - entry.at).count();
      feedback.complete.push_back(
          {entry.message,
           static_cast<std::uint32_t>(std::clamp<std::int64_t>(ago, 0, wire::kLongestAgo)),
           entry.dropped});
      --entry.left;
    }
    for (Entry& entry : refused_) {
      if (waits(entry)) continue;
      feedback.refused.push_back(entry.message);
      --entry.left;
    }
    const auto told = [](const Entry& entry) { return entry.left == 0; };
    std::erase_if(complete_, told);
    std::erase_if(refused_, told);
  }
  // The peer began a new life.
  void reset() {
    complete_.clear();
    refused_.clear();
  }

 private:
  // No measurement behind this value: it only has to make it rare that all tellings are lost,
  // which is one in a thousand where every tenth packet is.
  static constexpr std::uint32_t kTellings = 3;

  struct Entry {
    MessageId message{};
    TimePoint at{};
    std::uint32_t left = 0;
    bool dropped = false;
  };
  static void keep_few(std::deque<Entry>& entries, std::size_t most) {
    if (entries.size() >= most) entries.pop_front();
  }

  std::deque<Entry> complete_;
  std::deque<Entry> refused_;
};

}  // namespace interneuron::flow
