// What is remembered of the messages to one peer, for OnTimeForecasts. Pure.
#pragma once

#include <array>
#include <set>

#include "core/messages/on_time_bias.h"
#include "core/messages/on_time_law.h"
#include "core/messages/outlook.h"
#include "interneuron/send.h"

namespace interneuron {

// What was accepted and what became of it. Shares and means forget: they have the weight of up to
// some tens of messages. Fed by OnTimeForecasts, which bounds the number of records and of messages
// under way. A peer decides by its reports what its own record holds. Pure; thread-compatible.
class OnTimeRecord {
 public:
  // A message that was accepted.
  struct Message {
    TimePoint due{};
    Duration deadline{};
    Duration expected{};
    std::size_t bytes = 0;
    // The log-odds of the prediction without what was learnt of this peer, and all of it as a
    // probability.
    double raw = 0;
    double predicted = 0;
  };
  void sent(const Outlook& outlook, const Message& message);
  // Nothing more will be heard of it: it leaves what is under way, and nothing is learnt.
  void ended(const Message& message);
  // Its fate says whether it could be on time.
  void learn(const Message& message, const MessageFate& fate);

  // What the law weighs of a message that is sent now.
  OnTimeFeatures features(const Outlook& outlook) const;
  // What is to be added to these log-odds by what became of messages of which the law said about
  // as much.
  double correction(double log_odds) const { return bias_.at(log_odds); }
  // Nothing is under way.
  bool idle() const { return due_.empty(); }

 private:
  // Sums that forget, of messages and of those on time.
  struct Share {
    double messages = 0;
    double on_time = 0;
    void learn(double was_on_time, double keep);
    double log_odds() const;
  };
  double overdue(const Outlook& outlook) const;
  double demand(const Outlook& outlook) const;

  // Of the last few messages, and of late.
  Share last_;
  Share late_;
  // Seconds: by how much ages exceed what is expected, and how far from that they are.
  double excess_ = 0;
  double spread_ = 0.01;
  // Messages that were accepted: when the last one was, the mean gap between them in seconds and
  // their mean size in bytes.
  TimePoint last_at_ = TimePoint::min();
  double gap_ = 0;
  double size_ = 0;
  // When the messages under way should be there, and their bytes.
  std::multiset<TimePoint> due_;
  std::size_t under_way_ = 0;
  // By how much the law is wrong of this peer.
  OnTimeBias bias_;
};

}  // namespace interneuron
