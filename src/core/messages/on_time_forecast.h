// How likely it is that a message is at the other end by its deadline. Pure.
#pragma once

#include <cstdint>
#include <map>

#include "core/messages/on_time_record.h"
#include "core/messages/on_time_weights.h"
#include "core/messages/outlook.h"
#include "interneuron/send.h"

namespace interneuron {

// Which of the laws (src/core/messages/on_time_law.h) a message is judged by.
enum class OnTimeCase : std::uint8_t { kIdle, kLoaded, kRefused };

// What is predicted of a message; a plain value.
struct OnTimePrediction {
  // P(on time), in (0, 1).
  double probability = 0;
  // The log odds before the bias of the peer, beside which what becomes of the message is learnt.
  double unbiased = 0;
};

// Predicts P(on time) of messages to the peers of an endpoint, in three steps:
//
// 1. A law, fixed and fitted offline, weighs what is expected of the message, the state of its link
//    and the record of earlier messages to the same peer (a logistic regression).
// 2. Its knots put what it says right, by what was seen offline (a monotone recalibration).
// 3. The bias of the peer puts that right, by what became of its messages since (OnTimeBias). So
//    predictions come right again where the transport, or the network, is not what the laws were
//    fitted to.
//
// A refused message has no fate: for it there are the first two steps alone, and no record. What is
// predicted decides nothing, so it cannot feed back.
//
// Owned by Messages, which tells it of every message that is judged, accepted and settled, each
// once. Memory: some 200 bytes per peer until forget(), and some 200 per message under way, which
// SentMessages bounds; predict() allocates nothing. Logarithmic time per call. A peer decides by
// its reports what its own record holds, and so spoils what is predicted of messages to itself
// alone. Pure; thread-compatible; never throws but std::bad_alloc.
class OnTimeForecasts {
 public:
  explicit OnTimeForecasts(const OnTimeLaws& laws = kOnTimeLaws) : laws_(laws) {}
  OnTimePrediction predict(const Outlook& outlook) const;
  // The message, of which predict() said this, was accepted under this identifier. Others may have
  // been settled in between: those that it takes the place of.
  void sent(SendId id, const Outlook& outlook, const OnTimePrediction& predicted);
  // Its one fate. Nothing is learnt of messages that were cancelled or superseded, or whose peer is
  // gone. Fates of messages that sent() was not told of are ignored.
  void settled(const MessageFate& fate);
  // The peer has begun a new life, or is gone. Its messages are settled first.
  void forget(PeerId peer) { records_.erase(peer); }

  // What predict() weighs, and by which law: for those that fit the laws.
  OnTimeFeatures features(const Outlook& outlook) const;
  OnTimeCase case_of(const Outlook& outlook) const;

 private:
  struct UnderWay {
    PeerId peer{};
    OnTimeRecord::Message message;
  };
  const OnTimeRecord& record(PeerId peer) const;
  // After the second step.
  double log_odds(const Outlook& outlook) const;

  OnTimeLaws laws_;
  // Of a peer that nothing was sent to.
  OnTimeRecord fresh_;
  std::map<PeerId, OnTimeRecord> records_;
  std::map<SendId, UnderWay> under_way_;
};

}  // namespace interneuron
