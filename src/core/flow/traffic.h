// What a sender knows of the paths to its peer and of the messages under way, and the questions
// that are answered from it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/flat_map.h"
#include "core/base/id_tables.h"
#include "core/base/water_filling.h"
#include "core/flow/job_queue.h"
#include "core/flow/outgoing_message.h"
#include "core/flow/path_set.h"
#include "core/flow/path_view.h"
#include "core/flow/sent_packets.h"
#include "core/flow/windows.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Packets leave in batches of this much time at the pace, so that one system call carries several:
// 13 packets at 300 Mbit/s. In longer ones where that harms nobody (Traffic::batch).
inline constexpr Duration kQuantum = std::chrono::microseconds(500);

// A path as a sender keeps it: what is believed of it, what it still has to send, and what it has
// sent. A plain value of Traffic's. Sizes are bytes; those called ip_bytes include IP headers.
struct SendPath {
  // The largest UDP payload of its datagrams.
  std::size_t max_datagram = 0;
  PathView view;
  // When the pace allows the next packet to leave.
  TimePoint free_at = TimePoint::min();
  // When a packet left last, and the first one after the path had been idle.
  TimePoint left_at = TimePoint::min();
  TimePoint busy_since = TimePoint::min();
  // When poll() found nothing to send last.
  TimePoint idle_at = TimePoint::min();
  // Jobs of messages that are in Traffic::messages, and of no others.
  JobQueue jobs;
  SentPackets sent;
  PathUse use;
  CompletionLaw law;
  std::uint64_t resent = 0;
  std::uint64_t symbols = 0;

  // Whether its datagrams have room for a piece of so many bytes.
  bool can_carry(std::size_t piece_bytes) const {
    return max_datagram >= piece_bytes + kPieceOverheadBytes;
  }
  // Whether as much is in flight as congestion control allows or, where only bulk waits, as an idle
  // path takes and hardly more: a queue that bulk fills is one that others wait in. What waits
  // beside bulk need not wait for what is in flight of it.
  bool is_full() const {
    const std::size_t flying = sent.bytes_in_flight();
    if (!jobs.has_bulk()) return flying >= view.window;
    const std::size_t bulk = bulk_window();
    return flying >= (jobs.has_only_bulk() ? std::min(view.window, bulk)
                                           : std::max(view.window, bulk + kBesideBulk));
  }
  // Whether symbols of this message take nothing from other messages: the path carries less than it
  // can, or no other message waits for it.
  bool has_room_beside(MessageId message) const {
    return !view.loaded || jobs.size() <= (jobs.find(message) == nullptr ? 0U : 1U);
  }
  // When a message that is queued now is served among the others.
  JobQueue::Turn turn_of(TimePoint deadline, std::int16_t importance) const;
  JobQueue::Turn turn_of(const OutgoingMessage& m) const {
    return turn_of(m.deadline, m.importance);
  }
  // Bytes that leave before what is sent again of this message.
  std::size_t before_again(const OutgoingMessage& m) const;
  // The path as it would carry a message that is queued on it now.
  Way way_of(const OutgoingMessage& m) const;
  // From now until so many bytes are there that the path sends next.
  Duration time_to_bring(std::size_t ip_bytes) const;
  // From now until the last of so many bytes is there that are sent next over a loaded path, with a
  // margin for a message of which nothing has left yet. Zero while no rate is known.
  Duration least_time(std::size_t ip_bytes, bool begun) const;
  // See Sender::possible_time().
  Duration possible_time(TimePoint now, std::size_t ip_bytes) const;
  // A packet of so many bytes leaves: the next one may when the pace allows it.
  void occupy(TimePoint now, std::size_t ip_bytes);

 private:
  // What may leave beside as much bulk as may be in flight, in bytes: six packets. No measurement
  // behind this value: it only has to be more than one message that is urgent.
  static constexpr std::size_t kBesideBulk = 8192;
  // The bytes that bulk may have in flight, whatever congestion control allows.
  std::size_t bulk_window() const;
  // How long what is in flight beyond an empty path of this rate waits in a queue.
  Duration queue_at(DataRate rate) const;
  // What has left within so long may have arrived and not be told of: in flight it is no queue.
  Duration told_after() const { return 2 * view.least_one_way + view.report_spacing; }
};

// The messages that a sender keeps until they are acknowledged or their time is over. A message is
// found in O(1), added and erased in O(log n), and so is the one whose deadline is next. Memory
// grows with the largest number of messages at a time and is used again, but for the messages' own
// bytes. References are valid until the next add().
class MessageStore {
 public:
  OutgoingMessage* find(MessageId id) {
    const auto slot = by_id_.find(id);
    return slot ? &slots_[*slot] : nullptr;
  }
  const OutgoingMessage* find(MessageId id) const {
    return const_cast<MessageStore*>(this)->find(id);
  }

  // A new message of so many fragments, each queued on so many paths; the rest of it is for the
  // caller to fill in.
  OutgoingMessage& add(MessageId id, TimePoint deadline, std::uint16_t count, std::uint8_t paths);
  void erase(MessageId id);
  // When a message is to be looked at, whatever for; nothing: not at all.
  void look_at(MessageId id, std::optional<TimePoint> when);
  std::optional<TimePoint> next_look() const { return looks_.earliest(); }
  std::optional<MessageId> look_due(TimePoint now) const {
    const auto slot = looks_.due(now);
    return slot ? std::optional(slots_[*slot].id) : std::nullopt;
  }

  std::optional<TimePoint> next_deadline() const { return deadlines_.earliest(); }
  // A message whose deadline is at or before `now`.
  std::optional<MessageId> due(TimePoint now) const {
    const auto slot = deadlines_.due(now);
    return slot ? std::optional(slots_[*slot].id) : std::nullopt;
  }
  void clear() { *this = {}; }

 private:
  std::vector<OutgoingMessage> slots_;
  std::vector<std::uint32_t> free_;
  IdMap<MessageId> by_id_;
  Alarms deadlines_;
  Alarms looks_;
};

// The paths to one peer and the messages under way to it. Executor owns one; it and Sender change
// the three members, the planners (planners.h) read them. The questions change nothing; what they
// answer holds until any of the members changes.
//
// Memory is that of the members. The peer's reports decide what is known of its paths, which harms
// only what is sent to itself. Pure; thread-compatible; never throws.
struct Traffic {
  FlatMap<LinkId, SendPath> paths;
  MessageStore messages;
  WindowFlow window;
  // The sum of what the messages hold.
  std::size_t bytes = 0;
  // Whether lost fragments are sent again.
  bool repairs = true;

  // nullptr where there is no such path.
  const SendPath* find(LinkId path) const {
    const auto it = paths.find(path);
    return it == paths.end() ? nullptr : &it->second;
  }
  SendPath* find(LinkId path) { return const_cast<SendPath*>(std::as_const(*this).find(path)); }

  // Whether there is a path that may be relied on.
  bool any_is_sound() const;
  // The largest piece that all the paths of a plan carry, and those that may repair what they lose,
  // as far as they are up and carry enough.
  std::size_t piece_bytes(const PathList& plan, const PathSet& repairing) const;
  // Whether what is left of a job can arrive in time over its path.
  bool can_arrive(TimePoint now, const SendPath& path, const Job& job,
                  const OutgoingMessage& m) const;
  // How long packets of a path wait for each other, so that they leave together.
  Duration batch(const SendPath& path) const;
  // Whether what is queued or leaves on this path now could not be sent again in time if it is
  // lost.
  bool is_last(TimePoint now, const SendPath& path, const OutgoingMessage& m) const;

 private:
  bool together_can_arrive(TimePoint now, const OutgoingMessage& m) const;
};

}  // namespace interneuron::flow
