// How likely it is that a message is at the other end by its deadline. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <set>

#include "interneuron/link.h"
#include "interneuron/send.h"

namespace interneuron {

// What is known of a message when send() is called.
struct Outlook {
  PeerId peer{};
  TimePoint at{};
  Duration deadline{};
  // When it should be there over the link that brings it soonest; nothing: not known.
  std::optional<Duration> expected{};
  // Of the variant that goes over that link, and what our own sender sends before it.
  std::size_t bytes = 0;
  std::size_t ahead = 0;
  // It will not be sent, because it is expected too late.
  bool refused = true;
  // That link.
  LinkState link{};

  // Takes this way instead of the one before if it is sooner: of those that are not refused, or of
  // all while all are.
  void consider(const LinkState& way, std::optional<Duration> arrival, std::size_t bytes_ahead,
                std::size_t own_bytes, bool is_refused);
};

// Predicts P(on time) of messages to the peers of an endpoint, by a logistic regression on what is
// expected of the message, on the state of its link, and on what became of earlier messages to the
// same peer; what the regression says is then bent to the shares that were seen of it. Messages
// that are refused, that compete with others for the link, and all others each have a regression of
// their own. Their weights are fixed (src/core/messages/on_time_weights.h); what is learnt while
// running is the record of a peer: the share of messages that were on time, how far ages were from
// what was expected, which messages are overdue, and by how much predictions were too high or too
// low, which shifts the next ones. Records forget: they have the weight of some tens of messages. A
// refused message leaves no record, and the shift says nothing of it, because it was learnt of
// others.
//
// Owned by Messages, which tells it of every message that is judged, accepted and settled, each
// once. Memory: 100 bytes per peer until forget(), and some 150 per message under way, which
// SentMessages bounds. Logarithmic time per call. A peer decides by its reports what its own record
// holds, and so spoils what is predicted of messages to itself alone. Pure; thread-compatible;
// never throws but std::bad_alloc.
class OnTimeForecasts {
 public:
  // In (0, 1).
  double predict(const Outlook& outlook) const;
  // The message, of which predict() said this, was accepted under this identifier.
  void sent(SendId id, const Outlook& outlook, double predicted);
  // Its one fate. Nothing is learnt of messages that were cancelled or superseded, or whose peer is
  // gone. Fates of messages that sent() was not told of are ignored.
  void settled(const MessageFate& fate);
  // The peer has begun a new life, or is gone. Its messages are settled first.
  void forget(PeerId peer) { records_.erase(peer); }

 private:
  // Seconds.
  struct Record {
    // Sums that forget, of messages and of those on time.
    double messages = 0;
    double on_time = 0;
    // By how much ages exceed what is expected, and how far from that they are.
    double excess = 0;
    double spread = 0.01;
    // Added to the log-odds of messages that are not refused.
    double shift = 0;
    // When the messages under way should be there.
    std::multiset<TimePoint> due;
  };
  struct UnderWay {
    PeerId peer{};
    TimePoint due{};
    Duration deadline{};
    Duration expected{};
    double predicted = 0;
  };
  static void learn(Record& record, const UnderWay& message, const MessageFate& fate);

  std::map<PeerId, Record> records_;
  std::map<SendId, UnderWay> under_way_;
};

}  // namespace interneuron
