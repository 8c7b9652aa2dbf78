// Carries out what the planners order: the one place where fragments, symbols and messages are
// queued, sent again and given up.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/flow/planners.h"
#include "core/flow/traffic.h"

namespace interneuron::flow {

// Sender owns one and tells it what happens to messages and paths; for each it asks the planners
// what is to be done, and does it at once, because the next order depends on what was queued for
// the one before.
//
// Memory: beside the traffic, room for the pieces of one block, and what was given up since
// release(). Allocates per message, not per packet. Pure; thread-compatible; never throws but
// std::bad_alloc.
class Executor {
 public:
  explicit Executor(bool repairs) { traffic_.repairs = repairs; }

  Traffic& traffic() { return traffic_; }
  const Traffic& traffic() const { return traffic_; }

  // --- a message begins and ends
  // Queues all of a message on each of these paths, or shares of it.
  void enqueue(TimePoint now, OutgoingMessage& m, const PathList& paths, bool divided);
  // Nothing more of this message is sent.
  void forget(MessageId message);
  // Nothing more is sent of a message that is whole at the peer, nor of what it supersedes.
  void forget_whole(MessageId message);
  // The path sends no more of this job's message, but its alternative if there is one.
  void give_up(LinkId link, Job& job);
  // A message of kind kPlain that was given up before all of it had left; each once.
  std::optional<MessageId> poll_given_up();
  bool has_given_up() const { return !given_up_.empty(); }
  // Frees the bytes of messages that were given up, of which pieces may have been handed out.
  void release() { parting_.clear(); }

  // --- pieces leave, arrive and are lost
  // A path that has nothing to send takes the last piece of a divided message, or of a tight one
  // that it stands by for, from a path that would bring it later: what was believed of their rates
  // when it was planned may be wrong by now.
  // Returns whether there was one.
  bool take_over(TimePoint now, LinkId idle);
  // A copy leaves. When it was the last first copy of its message, symbols follow.
  void note_leaving(TimePoint now, LinkId link, OutgoingMessage& m, const JobQueue::Taken& taken);
  // Something is known of a piece that left over this path.
  void note_settled(TimePoint now, LinkId link, OutgoingMessage& m, std::uint16_t index);
  // Nothing more will be known of this message.
  void note_not_brought(TimePoint now, const OutgoingMessage& m);
  // A copy is lost. protect_touched() follows once all that a report has told of is settled.
  void lose(TimePoint now, OutgoingMessage& m, std::uint16_t index, Evidence evidence);

  // --- symbols
  // Symbols that are worth their bytes are queued, of all blocks.
  void protect(TimePoint now, OutgoingMessage& m, Protect what);
  // Symbols that are worth their bytes are queued for the messages whose losses have changed.
  void protect_touched(TimePoint now);
  // Symbols for what windows are to cover leave now.
  void send_window(TimePoint now);

  // --- what seems late
  // It is time to look whether a message needs rescue.
  void look_after(TimePoint now, OutgoingMessage& m);

  // --- a path that cannot be relied on
  // What these jobs still have of a message goes over the paths that there are.
  void hand_on(TimePoint now, JobQueue& jobs, MessageId message);
  // What is queued or in flight on a path that repairs nothing goes over the others, as far as they
  // bring it in time: of all messages, or of these only.
  void send_elsewhere(TimePoint now, LinkId link, const std::vector<MessageId>* only);
  // What is queued or in flight of those messages that fit elsewhere (plan_move()) goes there.
  void send_elsewhere_what_fits(TimePoint now, LinkId link);

  // Fragments that were not sent, or not sent again, because they would have been late.
  std::uint64_t cancelled() const { return cancelled_; }
  // The peer began a new life: forgets everything that is queued or in flight.
  void reset(TimePoint now);

 private:
  OutgoingMessage* find(std::optional<MessageId> message) {
    return message ? traffic_.messages.find(*message) : nullptr;
  }
  // Queues a lost fragment again. False when no path may carry it in time, or a copy that is under
  // way will be there sooner.
  bool repair(TimePoint now, OutgoingMessage& m, std::uint16_t index,
              Evidence evidence = Evidence::kSilence);
  void queue_again(TimePoint now, LinkId over, OutgoingMessage& m, std::uint16_t index);
  // What may be lost of the message has changed: symbols are weighed anew.
  void touch(const OutgoingMessage& m);
  void learn(TimePoint now, const OutgoingMessage::Share& share);
  bool join_window(TimePoint now, OutgoingMessage& m);
  void add_window_symbol(const WindowOrder& order);
  void begin_alternative(LinkId over, OutgoingMessage& m);
  void rescue(TimePoint now, LinkId over, OutgoingMessage& m);

  Traffic traffic_;
  std::deque<MessageId> given_up_;
  std::vector<Bytes> parting_;
  // Copies of pieces that do not lie in a payload as a whole, while symbols are made.
  Bytes scratch_;
  // Coded messages of which something was lost in the report that is taken in.
  std::vector<MessageId> touched_;
  std::uint64_t cancelled_ = 0;
};

}  // namespace interneuron::flow
