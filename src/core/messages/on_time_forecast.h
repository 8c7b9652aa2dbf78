// How likely it is that a message is at the other end by its deadline. Pure.
#pragma once

#include <cstddef>
#include <map>
#include <optional>

#include "interneuron/link.h"
#include "interneuron/message.h"
#include "interneuron/send.h"
#include "interneuron/units.h"

namespace interneuron::messages {

// What is known of a message when send() is called, as far as its chances depend on it. Plain
// values.
struct Outlook {
  PeerId peer{};
  Duration deadline{};
  // Bytes of the best variant.
  std::size_t bytes = 0;
  // The message will not be sent, because it cannot arrive in time.
  bool refused = true;
  // When the first variant that sets out should be there (SendResult::expected), and when the
  // smallest one would be if our own sender sent nothing before it. Nothing: not known.
  std::optional<Duration> expected{};
  std::optional<Duration> least{};
  // The state of the link that is expected to bring it.
  PathState path = PathState::kOk;
  DataRate rate{};
  DataRate share{};
  // Whether a link was considered.
  bool has_link = false;
};

// Predicts P(on time) of messages to the peers of an endpoint: a logistic law, fixed and fitted
// offline, weighs a few factors of the message, of its link and of what became of earlier messages
// to the same peer; the drift of the peer is added, by which its fates so far differed from what
// was predicted. So predictions come right again where the transport, or the network, is not what
// the law was fitted to. A refused message has no fate: it is judged without the drift. What is
// predicted decides nothing, so it cannot feed back.
//
// Owned by Messages, which tells it of every message that is accepted and settled, each once.
// Memory: some 100 bytes per peer until forget(), and per message under way, which SentMessages
// bounds; predict() allocates nothing. Logarithmic time per call. A peer decides by its reports
// what its own record holds, and so spoils what is predicted of messages to itself alone. Pure;
// thread-compatible; never throws but std::bad_alloc.
class OnTimeForecasts {
 public:
  // In (0, 1).
  double predict(const Outlook& outlook) const;
  // The message, of which predict() said this, was accepted under this identifier. Others may have
  // been settled in between: those that it takes the place of.
  void sent(SendId id, const Outlook& outlook, double predicted);
  // The one fate of a message. Nothing is learnt of messages that were cancelled or superseded, or
  // whose peer is gone. Fates of messages that sent() was not told of are ignored.
  void settled(const MessageFate& fate);
  // The peer has begun a new life, or is gone. Its messages are settled first.
  void forget(PeerId peer) { records_.erase(peer); }

 private:
  // What is remembered of one peer. Sums and means forget: the newest messages count most.
  struct Record {
    // Messages with a fate, and those of them that were on time.
    double messages = 0;
    double on_time = 0;
    // Seconds: by how much ages exceed what was expected, and how far from that they are.
    double excess = 0;
    double spread = 0.01;
    // Bytes and number of messages under way.
    std::size_t bytes_under_way = 0;
    std::size_t under_way = 0;
    // What is added to the log-odds of the law.
    double drift = 0;
  };
  struct UnderWay {
    PeerId peer{};
    std::size_t bytes = 0;
    Duration deadline{};
    Duration expected{};
    double predicted = 0;
  };
  struct Factors;
  static Factors factors(const Outlook& outlook, const Record& record);
  static void learn(Record& record, const UnderWay& message, const MessageFate& fate);

  std::map<PeerId, Record> records_;
  std::map<SendId, UnderWay> under_way_;
};

}  // namespace interneuron::messages
