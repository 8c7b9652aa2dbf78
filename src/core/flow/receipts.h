// What became of a peer's messages here, as our feedback tells it.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>

#include "core/wire/packet.h"
#include "interneuron/few.h"

namespace interneuron::flow {

// The messages that are complete and those that were refused. Each is told in kTellings packets of
// feedback, so that one lost packet does no harm; those that were told least come first, and of
// these the oldest, so that what finds no room is told by the next packet. Where more than kMost
// wait, the oldest are not told, and the sender never learns what became of them. Peer
// (src/core/peers) owns one. A peer that sends many small messages, or pieces of many that are
// refused, only loses tellings of its own. Memory grows to kMost of each. Pure; thread-compatible.
class Receipts {
 public:
  // Feedback about all paths comes 5 ms after a packet at the latest
  // (src/core/peers/feedback_due.h), so that this is the time of three.
  static constexpr Duration kLeftOver = std::chrono::milliseconds(20);

  void complete(TimePoint now, MessageId message) { add(complete_, now, message); }
  // This message, which is complete, was dropped: it was too late, or of a channel on which a newer
  // one was delivered.
  void mark_dropped(MessageId message) {
    const auto it =
        std::ranges::find(complete_.rbegin(), complete_.rend(), message, &Entry::message);
    if (it != complete_.rend()) it->dropped = true;
  }
  void refuse(TimePoint now, MessageId message) {
    std::erase_if(refused_, [message](const Entry& entry) { return entry.message == message; });
    add(refused_, now, message);
  }
  // Writes what is to be told into a feedback that leaves now. One that is not about all paths only
  // tells what is older than kLeftOver, because those about all paths have not come to it.
  void tell(TimePoint now, bool all_paths, wire::Feedback& feedback) {
    each(complete_, wire::kMaxComplete, now, all_paths, [&](const Entry& entry) {
      const auto ago = std::chrono::floor<std::chrono::microseconds>(now - entry.at).count();
      feedback.complete.push_back(
          {entry.message,
           static_cast<std::uint32_t>(std::clamp<std::int64_t>(ago, 0, wire::kLongestAgo)),
           entry.dropped});
    });
    each(refused_, wire::kMaxRefused, now, all_paths,
         [&](const Entry& entry) { feedback.refused.push_back(entry.message); });
  }
  // Whether there is something that no feedback has told yet.
  bool has_untold() const {
    const auto untold = [](const Entry& entry) { return entry.left == kTellings; };
    return std::ranges::any_of(complete_, untold) || std::ranges::any_of(refused_, untold);
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

  // Messages of one piece that may come between two packets of feedback: what a system call takes
  // in at once (64), four times.
  static constexpr std::size_t kMost = 256;

  struct Entry {
    MessageId message{};
    TimePoint at{};
    std::uint32_t left = 0;
    bool dropped = false;
  };
  static void add(std::deque<Entry>& entries, TimePoint now, MessageId message) {
    if (entries.size() >= kMost) entries.pop_front();
    entries.push_back({message, now, kTellings});
  }
  // Calls `what` with up to `room` entries that are to be told now.
  template <class What>
  static void each(std::deque<Entry>& entries, std::size_t room, TimePoint now, bool all_paths,
                   const What& what) {
    Few<Entry*, kMost> due;
    for (std::uint32_t left = kTellings; left > 0; --left) {
      for (Entry& entry : entries) {
        if (entry.left != left || (!all_paths && now - entry.at < kLeftOver)) continue;
        if (due.size() < room) due.push_back(&entry);
      }
    }
    for (Entry* entry : due) {
      what(*entry);
      --entry->left;
    }
    std::erase_if(entries, [](const Entry& entry) { return entry.left == 0; });
  }

  std::deque<Entry> complete_;
  std::deque<Entry> refused_;
};

}  // namespace interneuron::flow
