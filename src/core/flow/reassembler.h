// The messages of one peer, put together from their fragments in bounded memory and forgotten when
// they can no longer arrive by their deadline.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/alarms.h"
#include "core/base/id_tables.h"
#include "core/flow/partial.h"
#include "core/wire/message_bytes.h"
#include "interneuron/ledger.h"
#include "interneuron/message.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Upper bounds of own clock - origin clock, to tell when a message has expired (docs/paper.md,
// "Expiry at a receiver"). A round's t0 may be ours, the peer's or that of an origin further away,
// of whose clock nothing is known here.
struct ClockBounds {
  SessionId self{};
  SessionId peer{};
  std::optional<Duration> peer_hi_min;

  std::optional<Duration> above(SessionId origin) const {
    if (origin == self) return Duration::zero();
    if (origin == peer) return peer_hi_min;
    return std::nullopt;
  }
};

// Puts the fragments of one peer's messages together, which come in any order, over several paths,
// and more than once. Peer (src/core/peers) owns one and feeds it every data packet that a
// PathReceiver has accepted; a message that is complete is handed out at once and forgotten.
//
// Memory is taken for the fragments that have come and not for what they say of the message's size
// (Partial), and none for a message of one piece. It is freed when the message is complete, or
// expires because it can no longer arrive by its deadline, or because no new fragment of it has
// come for Limits::life: so a long message of a slow link lives as long as it grows, and a claim
// that nobody follows up does not. Limits bounds what one peer's messages may hold. Where that does
// not suffice, messages that expire before this one make room, the next to expire first: else one
// that nobody sends any more could keep out the first fragments of the next, which then could not
// be completed either, and so on. Other fragments are refused and counted.
//
// What a hostile peer could try: claim large messages that it never completes, or many small ones;
// such a claim costs some KB until Limits::life is over, and only its own messages are refused.
// Send fragments of one message that disagree about its size or chunk; those that differ from the
// first are dropped. Send a message again after it is complete; the newest 512 identifiers are
// remembered, and later fragments of these are duplicates; so are those of 512 plain messages that
// never became complete. In the clear fragments are not authenticated, so an attacker who knows the
// peer's session can do all this in its name.
//
// Pure; thread-compatible; never throws but std::bad_alloc.
class Reassembler {
 public:
  static constexpr std::size_t kMaxBytes = kReassemblyBytes;
  static constexpr std::size_t kMaxPartials = kReassemblyMessages;
  struct Limits {
    // Bytes that the peer's incomplete messages hold, with what is kept beside each.
    std::size_t bytes = kMaxBytes;
    // Incomplete messages of the peer.
    std::size_t messages = kMaxPartials;
    // How long one lives of which nothing comes.
    Duration life = kLongestBelieved;
  };
  Reassembler() : Reassembler(Limits{}) {}
  explicit Reassembler(const Limits& limits) : limits_(limits) {}

  // Messages remembered as complete or expired: 16 rounds of 8 variants fit four times.
  static constexpr std::size_t kBuried = 512;
  // Plain messages remembered whose sender is told that they never will be complete. Apart from the
  // others, which would take their places within a tenth of a second at 5,000 small messages a
  // second.
  static constexpr std::size_t kRefused = 512;

  enum class Result : std::uint8_t {
    // The message is not complete yet.
    kStored,
    // This was its last fragment.
    kComplete,
    // The fragment is there already, or its message is complete or expired.
    kDuplicate,
    // There is no room. Of a plain message that is final: its sender is told, so that no further
    // fragment of it is taken.
    kRefused,
    // The fragment contradicts those before, which stay, or is a symbol that is longer than any
    // that can be decoded.
    kBad,
  };
  struct Outcome {
    Result result{};
    // The whole message when it is complete.
    wire::MessageBytes message;
    // A limit has struck: another message has made room, or the fragment was refused.
    bool limited = false;
    // Pieces that the message lacks still, where the fragment was stored.
    std::size_t missing = 0;
  };
  // `clocks` bounds the offset of the origin's clock, so that the message's header, once its first
  // fragment is there, can shorten its life (docs/paper.md, "Expiry at a receiver"). `room`: how
  // many bytes more may be held than now, beside Limits.
  Outcome add(TimePoint now, const wire::Data& data, const ClockBounds& clocks,
              std::size_t room = SIZE_MAX);

  // Nothing of the message that this is a fragment of is wanted: what is there of it is dropped,
  // and further fragments are duplicates.
  void refuse(const wire::FragmentHeader& fragment);

  // Messages that were forgotten incomplete and never will be complete: those that had to make room
  // for another one, and plain ones whose time was over. Each once.
  std::optional<MessageId> poll_forgotten() {
    if (forgotten_.empty()) return std::nullopt;
    const MessageId message = forgotten_.back();
    forgotten_.pop_back();
    return message;
  }
  // Forgets the messages that can no longer arrive by their deadline; returns how many there were.
  std::size_t expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  // Bytes held by incomplete messages.
  std::size_t bytes() const { return bytes_; }
  std::size_t messages() const { return by_id_.size(); }

 private:
  struct Place {
    MessageId id{};
    Partial partial;
    // When it can no longer arrive by its deadline, and when it expires: then or before, if nothing
    // comes until then.
    TimePoint too_late{};
    TimePoint expires{};
  };
  // What becomes of a fragment of a message that is not there; nothing: the message begins.
  std::optional<Outcome> answer(const wire::Data& data, std::size_t room);
  Outcome refuse_for_now(const wire::FragmentHeader& fragment);
  std::uint32_t open(const wire::FragmentHeader& fragment, TimePoint too_late, TimePoint expires);
  // Makes room for a fragment that takes so many bytes, of a message that expires then. False:
  // there can be no room.
  bool make_room(std::size_t size, TimePoint expires, std::size_t room, bool is_new);
  void forget_first();
  Outcome take(TimePoint now, std::uint32_t place, const wire::Data& data,
               const ClockBounds& clocks);
  void bury(MessageId message);
  void give_up(MessageId message);
  void refine_expiry(std::uint32_t place, const wire::Data& first, const ClockBounds& clocks);

  Limits limits_;
  // Places of messages that are complete or expired are empty and listed in free_.
  std::vector<Place> places_;
  std::vector<std::uint32_t> free_;
  IdMap<MessageId> by_id_;
  // When each place expires.
  Alarms expiries_;
  // Messages that are complete or expired, whose further fragments are duplicates; and plain ones
  // that are neither and never will be complete.
  RecentSet<MessageId, kBuried> buried_;
  RecentSet<MessageId, kRefused> refused_;
  std::vector<MessageId> forgotten_;
  std::size_t bytes_ = 0;
};

}  // namespace interneuron::flow
