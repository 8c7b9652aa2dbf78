// What has arrived, as our feedback tells it to the peer: packets, path by path, and messages.
// Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "core/wire/feedback.h"
#include "interneuron/few.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Which packets have arrived on one path, for the feedback that tells the peer: acknowledgements,
// our half of the clock exchange, and the dispersion of the newest train. Path (src/core/peers)
// feeds it every packet whose session is the peer's.
//
// A packet is accepted once: its number must be larger than all before, or one of the
// wire::kAckWindow before the largest that has not arrived. In the clear numbers are not
// authenticated, so an attacker who writes one packet with a huge number makes all true ones look
// too old; Peers takes care that for this he has to know a vehicle's session or to forge the
// address of a peer that we connected to. Constant memory.
//
// A train ends with a pause that is long beside the gaps that it has had, so that one of a slow
// link, whose packets are tens of milliseconds apart, is measured like one of a fast link. What
// came too closely together to say anything waits for what follows. Probes begin a train of their
// own, in which data may lie: messages every 10 ms leave no pause that would tell it from them.
// Whether a pause was the link's or the sender's own the receiver cannot know; the sender does
// (SentTrain).
class PathReceiver {
 public:
  explicit PathReceiver(LinkId link) : link_(link) {}

  // What a packet is to a train: nothing; data, or a probe of the path.
  enum class Role : std::uint8_t { kNone, kData, kProbe };
  // A packet came in. False when it is a duplicate: its number was seen before or is too old to
  // tell, unless `is_new`: whoever has opened the packet knows that it has not come before, however
  // old it is. Then it counts, and only no acknowledgement tells of it. `ip_bytes`: its size with
  // IP headers; `ecn`: its ECN bits.
  bool accept(TimePoint now, std::uint64_t number, Role role, std::size_t ip_bytes,
              std::uint8_t ecn = 0, bool is_new = false);
  // A feedback of the peer came in on this path, which left at `u` on the peer's clock.
  void exchange(TimePoint now, PeerTime u);
  // The path's part of a feedback sent at `now`.
  wire::LinkReport report(TimePoint now) const;
  // A packet with data or padding was accepted that carried this stamp.
  void note_delay(TimePoint now, std::uint32_t stamp_us);
  // The packet that came last is the last of its message.
  void message_ends();
  // The largest number that has come in; 0 before the first.
  std::uint64_t largest() const { return largest_; }
  // Whether a packet number was skipped since reported() was called.
  bool gap() const { return gap_; }
  void reported() { gap_ = largest_is_fresh_ = false; }

 private:
  struct Train {
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
    void begin(TimePoint now, std::uint64_t number);
    void add(TimePoint now, std::size_t ip_bytes);
    Duration mean_gap() const { return packets > 1 ? (last - first) / (packets - 1) : Duration{}; }
    // Whether a packet that comes now begins another train.
    bool ends(TimePoint now) const;
    // Whether it tells a rate: no single gap makes up most of it.
    bool even() const;
  };
  void extend_train(TimePoint now, std::uint64_t number, Role role, std::size_t ip_bytes);
  bool ends_train(TimePoint now, Role role) const;

  LinkId link_;
  std::uint64_t largest_ = 0;
  // As on the wire: bit i stands for packet largest_ - 1 - i.
  wire::AckBitmap bitmap_{};
  bool gap_ = false;
  // When the peer sent its newest feedback, by its clock, and when it came in.
  std::optional<PeerTime> u_;
  TimePoint u_at_{};
  Train train_;
  // It began with a probe.
  bool probing_ = false;
  // What has come since the newest long gap of the train, and that gap.
  Train tail_;
  Duration gap_before_tail_{};
  // With IP headers.
  std::uint64_t received_bytes_ = 0;
  // Packets that said that their sender understands marks and were not marked, and marked ones.
  std::uint16_t ect0_ = 0;
  std::uint32_t ect1_ = 0;
  std::uint32_t ce_ = 0;
  // Microseconds modulo 2^32: of the newest packet, and the largest since reported() was called; if
  // there was none since, the one from before.
  std::optional<std::uint32_t> newest_delay_;
  std::uint32_t largest_delay_ = 0;
  bool largest_is_fresh_ = false;
};

// What became of the peer's messages here: those that are complete and those that were refused.
// Each is told in kTellings packets of feedback, so that one lost packet does no harm; those that
// were told least come first, and of these the oldest, so that what finds no room is told by the
// next packet. Where more than kMost wait, the oldest are not told, and the sender never learns
// what became of them. Peer (src/core/peers) owns one. A peer that sends many small messages, or
// pieces of many that are refused, only loses tellings of its own. Memory grows to kMost of each.
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
  // This message, which has just become complete, is kept for a better variant of it.
  void mark_kept(MessageId message) {
    if (!complete_.empty() && complete_.back().message == message) complete_.back().kept = true;
  }
  // What has become of a message that was kept and was complete at this instant.
  void settle_kept(MessageId message, TimePoint at, bool dropped) {
    std::erase_if(complete_, [message](const Entry& entry) { return entry.message == message; });
    add(complete_, at, message);
    complete_.back().dropped = dropped;
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
           entry.dropped, entry.kept});
    });
    each(refused_, wire::kMaxRefused, now, all_paths,
         [&](const Entry& entry) { feedback.refused.push_back(entry.message); });
  }
  // Whether there is something that no feedback has told yet.
  bool has_untold() const {
    const auto untold = [](const Entry& entry) { return entry.left == kTellings; };
    return std::ranges::any_of(complete_, untold) || std::ranges::any_of(refused_, untold);
  }

 private:
  // All of them are lost once in a thousand where every tenth packet is.
  static constexpr std::uint32_t kTellings = 3;
  // Messages of one piece between two packets of feedback: four system calls of 64 packets.
  static constexpr std::size_t kMost = 256;

  struct Entry {
    MessageId message{};
    TimePoint at{};
    std::uint32_t left = 0;
    bool dropped = false;
    bool kept = false;
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
