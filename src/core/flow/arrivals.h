// What has arrived, as our feedback tells the peer: packets and messages. Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>

#include "core/flow/received_train.h"
#include "core/wire/feedback.h"
#include "interneuron/few.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Which packets have arrived on one path, for the feedback that tells the peer: acknowledgements,
// our half of the clock exchange, and the dispersion of the newest train. Path (src/core/peers)
// feeds it every packet whose session is the peer's.
//
// A packet is accepted once: its number must be larger than all before, or one of the
// wire::kAckWindow before the largest that has not arrived. In the clear an attacker who writes one
// packet with a huge number makes all true ones look too old; Peers takes care that for this he has
// to know a vehicle's session or to forge the address of a peer. Constant memory.
//
// A train ends with a pause that is long beside the gaps that it has had, so that one of a slow
// link, whose packets are tens of milliseconds apart, is measured like one of a fast link. What
// came too closely together to say anything waits for what follows. Probes begin a train of their
// own, in which data may lie: messages every 10 ms leave no pause that would tell it from them. By
// the stamps of packets a pause is told to be the sender's own or that of a link that is granted in
// bursts.
class PathReceiver {
 public:
  explicit PathReceiver(LinkId link) : link_(link) {}

  // What a packet is to a train: nothing; data, or a probe of the path.
  enum class Role : std::uint8_t { kNone, kData, kProbe };
  // A packet came in. False when it is a duplicate: its number was seen before or is too old to
  // tell, unless `is_new`: whoever has opened the packet knows that it has not come before. Then it
  // counts, and only no acknowledgement tells of it. `ip_bytes`: its size with IP headers; `ecn`:
  // its ECN bits; `stamp_us`: when it left, if that is known.
  bool accept(TimePoint now, std::uint64_t number, Role role, std::size_t ip_bytes,
              std::uint8_t ecn = 0, bool is_new = false,
              std::optional<std::uint32_t> stamp_us = {});
  // A feedback that left at `u` on the peer's clock came in on this path.
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
  void extend_train(TimePoint now, std::uint64_t number, Role role, std::size_t ip_bytes,
                    std::optional<std::uint32_t> stamp_us);
  bool ends_train(TimePoint now, Role role, Duration pause) const;
  bool is_regular(TimePoint now, Duration gap);
  bool tells_rate(TimePoint now) const;

  LinkId link_;
  std::uint64_t largest_ = 0;
  // As on the wire: bit i stands for packet largest_ - 1 - i.
  wire::AckBitmap bitmap_{};
  bool gap_ = false;
  // When the peer sent its newest feedback, by its clock, and when it came in.
  std::optional<PeerTime> u_;
  TimePoint u_at_{};
  ReceivedTrain train_;
  // It began with a probe.
  bool probing_ = false;
  // The stamp of the newest packet of the train.
  std::optional<std::uint32_t> last_stamp_us_;
  // What has come since the newest long gap of the train, and that gap.
  ReceivedTrain tail_;
  Duration gap_before_tail_{};
  // The newest long gap between packets that left together, and when it ended.
  Duration long_gap_{};
  TimePoint long_gap_at_{};
  // The mean gap of the newest train that has shown the link to be granted in bursts, and when that
  // was.
  Duration ungranted_{};
  std::optional<TimePoint> granted_at_;
  // With IP headers.
  std::uint64_t received_bytes_ = 0;
  // Packets with ECT that were not marked, and marked ones.
  std::uint16_t ect0_ = 0;
  std::uint32_t ect1_ = 0;
  std::uint32_t ce_ = 0;
  // Microseconds modulo 2^32: the newest packet's, and the largest since reported(), or before it.
  std::optional<std::uint32_t> newest_delay_;
  std::uint32_t largest_delay_ = 0;
  bool largest_is_fresh_ = false;
};

// What became of the peer's messages here: those that are complete and those that were refused.
// Each is told in kTellings packets of feedback; those told least come first, then the oldest.
// Where more than kMost wait, the oldest are not told, and the sender never learns of them. Peer
// (src/core/peers) owns one: a peer only loses tellings of its own. Memory grows to kMost of each.
class Receipts {
 public:
  // The time of three packets of feedback about all paths (src/core/peers/feedback_due.h).
  static constexpr Duration kLeftOver = std::chrono::milliseconds(20);
  void complete(TimePoint now, MessageId message) { add(complete_, now, message); }
  // This message, which is complete, was dropped: too late, or a newer one was delivered.
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
  // Writes what is to be told into a feedback that leaves now. One that is not about all paths
  // tells only what is older than kLeftOver: those about all paths have not come to it.
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
