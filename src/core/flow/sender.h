// The sending side of one peer: messages are cut into fragments that fit the path, so that IP never
// fragments, and leave paced per path, earliest deadline first and over a loaded path what matters
// more before that. Fragments found lost are sent again over the path that brings them soonest,
// while the deadline allows.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/flow/executor.h"
#include "core/flow/overdue.h"
#include "core/flow/path_view.h"
#include "core/wire/feedback.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// Owned by the Peer that it sends to. In the order of use: send() queues a message on paths; poll()
// gives the next fragment that may leave a path now; report() and handle_timeout() tell what
// arrived or must be taken for lost. What is known lies in Traffic; what is to be done the planners
// say (planners.h) and Executor does.
//
// Memory: every message is kept until it is acknowledged or its deadline passes, so the application
// bounds it by what it submits. The time of a call does not grow with the messages under way, but
// for a logarithm, and that of queued_before() with those of other turns.
// The peer's reports decide what is sent again; a peer that denies everything makes us send again
// what the deadlines and the pace allow, to itself alone. Pure; thread-compatible; never throws;
// allocates per message, not per packet.
class Sender {
 public:
  struct Options {
    // Whether lost fragments are sent again.
    bool repair = true;
    // The identifier of the first message; the following ones count up.
    MessageId first_message{};
  };
  explicit Sender(Options options)
      : executor_(options.repair), next_message_(options.first_message.value) {}

  // Adds a path whose datagrams have at most `max_datagram` bytes of UDP payload, unless it is
  // known already. Its packets are numbered from `first_number` on, or from above all numbers of
  // the paths that were removed: no number is used twice by paths of one name.
  void add_path(LinkId path, std::size_t max_datagram, std::uint64_t first_number = 1);
  // The path's datagrams may have so many bytes from now on. What was cut for larger ones leaves
  // over other paths or not at all; what has left already may have arrived.
  void resize(TimePoint now, LinkId path, std::size_t max_datagram);
  // Removes a path; what it still had to send goes over the other paths.
  void remove_path(TimePoint now, LinkId path);
  void set_path(LinkId path, const PathView& view);
  // Nothing more goes over this path until set_path() says that it is up again. What is queued or
  // in flight on it goes over the other paths at once, where that still helps.
  void pull(TimePoint now, LinkId path);
  // Nobody knows when the path brings what it was given, until set_path() says otherwise. A
  // plain message that is queued or in flight on it goes over another one at once, where that
  // brings all of it in time; the others stay. Repairs use it only where no other path is up.
  void doubt(TimePoint now, LinkId path);

  // When a message is of use, and for how long the receiver may keep fragments of it.
  struct Times {
    TimePoint deadline{};
    // The deadline may be so much later than believed: it is another host's, and clocks differ.
    Duration doubt{};
    Duration lifetime{};
    // When it should be there to be of full use, if that is before the deadline: symbols, shares
    // and rescues are planned for this instant.
    TimePoint aim = TimePoint::max();
    // 0 the least. Over a loaded path what matters more leaves first; else it makes no difference.
    // kBulkImportance: after all else.
    std::int16_t importance = kUsualImportance;
  };
  // Queues a message (its header and payload) on these paths, in pieces that all of them carry, and
  // all that may repair as well where that is worthwhile. What is lost of it is sent again
  // over these paths and those of `repairs` alone. After its deadline nothing of it is sent, and a
  // loaded path gives it up as soon as the rest of it cannot arrive in time over that path, so that
  // others can. A message of more than 65,535 fragments, an empty one or one that is late
  // already is not sent at all.
  MessageId send(TimePoint now, const Times& times, wire::MessageBytes message,
                 const PathList& paths, const PathSet& repairs = kEveryPath,
                 wire::MessageKind kind = wire::MessageKind::kRound,
                 const Protection& protection = {});
  // A smaller variant of `first` that takes its place when its path gives it up before its deadline
  // and this one can still arrive; told of like any other message. `first` was queued on one path;
  // else, or where it is gone already, the alternative does not take its place. Over one of the
  // paths `rescue` it goes beside `first` when that seems late.
  MessageId add_alternative(TimePoint now, MessageId first, wire::MessageBytes message,
                            const PathSet& rescue = {});
  // `worse` is a smaller variant of `better` that goes beside it: once `better` is whole at the
  // peer, nothing more of `worse` is sent, neither what waits nor what is lost.
  void supersede(MessageId better, MessageId worse);
  // Forget a message: nothing more of it is sent. It is complete at the peer, or nobody wants it.
  void complete(TimePoint now, MessageId message);
  void cancel(MessageId message) { executor_.forget(message); }

  // Messages that cannot be complete at the peer: those that their only path has given up before
  // all of them had left, and those that were incomplete at their deadline (Overdue). Each once,
  // and only those of kind kPlain.
  std::optional<MessageId> poll_given_up() { return executor_.poll_given_up(); }
  std::optional<MessageId> poll_incomplete() { return overdue_.poll(); }
  bool has_failed() const { return executor_.has_given_up() || overdue_.has_any(); }
  // The peer's reports of one feedback, which it sent at `left` or later; nothing: not known when.
  void settle_overdue(std::span<const wire::LinkReport> reports, std::optional<TimePoint> left);
  // Whether so little of this message has left, over whichever path, that the peer cannot have it.
  bool is_surely_incomplete(MessageId message) const;
  // Bytes of the messages that are under way.
  std::size_t bytes() const { return traffic().bytes; }
  // Bytes that this path has to send before a message of this deadline and importance.
  std::size_t queued_before(LinkId path, TimePoint deadline, std::int16_t importance) const;
  // From now until so many bytes (with IP headers) could be there that are sent next over this
  // path; nothing while it is not loaded, then nothing is given up.
  std::optional<Duration> least_time(LinkId path, std::size_t ip_bytes) const;
  // How long so many bytes take over this path at least, however much waits on it now: if it
  // carries the best of what it has carried lately, and the more beyond it the longer ago that was
  // measured. Zero while nothing is known.
  Duration possible_time(TimePoint now, LinkId path, std::size_t ip_bytes) const;

  // Whether the peer decodes window symbols; none are sent until it is known to.
  void set_windows(bool understood) { traffic().window.set_understood(understood); }

  // The next packet number of a path, for packets that carry no fragment; they count as sent.
  // `train_bytes` is the size with IP headers of packets that belong to a train, 0 for all others.
  std::uint64_t take_number(TimePoint now, LinkId path, std::size_t train_bytes = 0);
  // The same for a probe of the path's MTU.
  std::uint64_t take_mtu_probe_number(TimePoint now, LinkId path, std::size_t ip_bytes);

  // A fragment that may leave `path` now; its payload is valid until something is
  // taken in (send(), cancel(), report(), handle_timeout(), a path that goes), its header only
  // until the next call. Nothing when none may leave.
  struct Piece {
    std::uint64_t number = 0;
    wire::FragmentHeader fragment;
    wire::MessageBytes::Part bytes;
    // Else it is a window symbol over several messages, `bytes` are its own, and the fragment means
    // nothing; all of it is valid until the next call alone.
    const wire::WindowHeader* window = nullptr;
    // The round whose message the fragment is of.
    std::optional<RoundRef> round{};
  };
  std::optional<Piece> poll(TimePoint now, LinkId path);

  // The peer's report of a path came in; what it says is lost is queued again. See
  // SentPackets::report().
  SentPackets::Verdicts report(TimePoint now, const wire::LinkReport& report,
                               Duration min_rtt = {});
  // How the path was used since the last call.
  PathUse::Told take_use(TimePoint now, LinkId path);
  // The rate at which the newest messages are sent early enough (PathUse::Told), of the path that
  // needs most; zero before the first one.
  DataRate needed() const;

  // Fragments in flight for longer than their path's probe timeout count as lost and are queued
  // again. Forgets messages whose deadline has passed.
  void handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  // When poll() should be called for a path that has something queued. Whether anything may be sent
  // on it at all (address validation, budgets) is for the caller to know.
  std::optional<TimePoint> next_send(LinkId path) const;

  // Fragments sent again over a path, and repair symbols of messages and of windows.
  std::uint64_t resent(LinkId path) const;
  std::uint64_t symbols(LinkId path) const;
  // Packets found lost on a path, by the peer's feedback or its silence.
  std::uint64_t lost(LinkId path) const;
  // Fragments that were not sent, or not sent again, because they would have been late.
  std::uint64_t cancelled() const { return executor_.cancelled(); }
  // The peer began a new life: forgets everything that is queued or in flight.
  void reset(TimePoint now) {
    overdue_.clear();
    executor_.reset(now);
  }

 private:
  Traffic& traffic() { return executor_.traffic(); }
  const Traffic& traffic() const { return executor_.traffic(); }
  Job* next_job(TimePoint now, LinkId link, SendPath& path);
  std::optional<JobQueue::Taken> take(SendPath& path, Job& job);
  std::optional<Piece> take_window_symbol(TimePoint now, LinkId link, SendPath& path);
  void settle(TimePoint now, LinkId link, const SentPackets::Settled& settled, Evidence evidence);
  void note_overdue(TimePoint now, const OutgoingMessage& m);

  Executor executor_;
  Overdue overdue_;
  // When a path was removed last.
  TimePoint removed_at_ = TimePoint::min();
  // Above all numbers of packets of paths that were removed.
  std::uint64_t unused_number_ = 1;
  std::uint32_t next_message_;
};

}  // namespace interneuron::flow
