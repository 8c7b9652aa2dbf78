// The sending side of one peer: messages are cut into fragments that fit the path, so that IP never
// fragments, and leave paced per path, earliest deadline first and over a loaded path what matters
// more before that. Fragments found lost are sent again over the path that brings them soonest,
// while the deadline allows.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/base/flat_map.h"
#include "core/base/water_filling.h"
#include "core/flow/completion_law.h"
#include "core/flow/job_queue.h"
#include "core/flow/message_store.h"
#include "core/flow/overdue.h"
#include "core/flow/path_set.h"
#include "core/flow/path_use.h"
#include "core/flow/path_view.h"
#include "core/flow/sent_packets.h"
#include "core/flow/window_flow.h"
#include "core/wire/packet.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// What else may be done for a message.
struct Helpers {
  // Its paths divide it among them, so that the last part is there as soon as possible.
  bool divided = false;
  // Paths that may carry repair symbols of it: as many as are worth it
  // (src/core/code/redundancy.h) for what nobody can ask for again. They leave when all of the
  // message has left, or at once where that would be too late for them.
  PathSet symbols{};
  // Paths over which what is missing of it goes when it seems late (sender_rescue.cc).
  PathSet rescue{};
};

// Owned by the Peer that it sends to. In the order of use: send() queues a message on paths; poll()
// gives the next fragment that may leave a path now; report() and handle_timeout() tell what
// arrived or must be taken for lost.
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
      : options_(options), next_message_(options.first_message.value) {}

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
    std::uint8_t importance = kUsualImportance;
  };
  // Queues a message (its header and payload) on these paths, in pieces that all of them carry, and
  // all that may repair as well where that is worthwhile. What is lost of it is sent again
  // over these paths and those of `repairs` alone. After its deadline nothing of it is sent, and a
  // loaded path gives it up as soon as the rest of it cannot arrive in time over that path, so that
  // others can. A message of more than 65,535 fragments, an empty one or one that is late
  // already is not sent at all.
  MessageId send(TimePoint now, const Times& times, wire::MessageBytes message,
                 const std::vector<LinkId>& paths, const PathSet& repairs = kEveryPath,
                 wire::MessageKind kind = wire::MessageKind::kRound, const Helpers& helpers = {});

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
  void cancel(MessageId message) { forget(message); }
  // Bytes of the messages that are under way.
  std::size_t bytes() const { return bytes_; }
  // Messages that cannot be complete at the peer: those that their only path has given up before
  // all of them had left, and those that were incomplete at their deadline (Overdue). Each once, of
  // those of kind kPlain alone.
  std::optional<MessageId> poll_given_up() {
    if (given_up_.empty()) return std::nullopt;
    const MessageId message = given_up_.front();
    given_up_.pop_front();
    return message;
  }
  std::optional<MessageId> poll_incomplete() { return overdue_.poll(); }
  // The peer's reports of one feedback, which it sent at `left` or later; nothing: not known when.
  void settle_overdue(std::span<const wire::LinkReport> reports, std::optional<TimePoint> left) {
    for (const wire::LinkReport& report : reports) {
      if (paths_.contains(report.link)) overdue_.report(report, left);
    }
  }
  // Whether so little of this message has left, over whichever path, that the peer cannot have it.
  bool is_surely_incomplete(MessageId message) const;
  // Bytes that this path has to send before a message of this deadline and importance.
  std::size_t queued_before(LinkId path, TimePoint deadline, std::uint8_t importance) const;

  // Whether the peer decodes window symbols; none are sent until it is known to.
  void set_windows(bool understood) { window_.set_understood(understood); }

  // From now until so many bytes (with IP headers) could be there that are sent next over this
  // path; nothing while it is not loaded, then nothing is given up.
  std::optional<Duration> least_time(LinkId path, std::size_t ip_bytes) const;

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
  std::uint64_t cancelled() const { return cancelled_; }
  // The peer began a new life: forgets everything that is queued or in flight.
  void reset(TimePoint now);

 private:
  using Message = OutgoingMessage;
  struct Path {
    std::size_t max_datagram = 0;
    PathView view;
    // When the pace allows the next packet to leave.
    TimePoint free_at = TimePoint::min();
    // When poll() found nothing to send last.
    TimePoint idle_at = TimePoint::min();
    // Of messages that are in messages_ alone.
    JobQueue jobs;
    SentPackets sent;
    PathUse use;
    CompletionLaw law;
    std::uint64_t resent = 0;
    std::uint64_t symbols = 0;
  };

  std::size_t piece_bytes(const std::vector<LinkId>& paths, const PathSet& repairs) const;
  bool any_is_sound() const;
  std::vector<MessageId> fitting_elsewhere(TimePoint now, Path& path);
  void send_elsewhere(TimePoint now, Path& path, const std::vector<MessageId>* only);
  void hand_on(TimePoint now, JobQueue& jobs, MessageId id);
  // The next fragment of a job that is not acknowledged yet.
  std::optional<JobQueue::Taken> take(Path& path, Job& job);
  Job* next_job(Path& path, TimePoint now);
  // When a message of this deadline and importance that is queued now is served.
  static JobQueue::Turn turn_of(const Path& path, TimePoint deadline, std::uint8_t importance);
  // Whether what is left of a job can arrive in time.
  bool can_arrive(TimePoint now, const Path& path, const Job& job, const Message& message) const;
  // The path sends no more of this job's message, but its alternative if there is one.
  void give_up(Path& path, Job& job);
  void begin_alternative(Path& path, Message& message);
  // The deadline of a message has passed before it was acknowledged.
  void note_overdue(TimePoint now, const Message& message);
  static bool is_full(const Path& path) { return path.sent.bytes_in_flight() >= path.view.window; }
  // Nothing more of this message is sent.
  void forget(MessageId message);
  // The same of one that is whole at the peer, and of what it supersedes.
  void forget_whole(MessageId message);
  // What tells of a loss: the peer's report of later packets, or that it reports nothing.
  enum class Evidence : std::uint8_t { kReport, kSilence };
  // Queues a lost fragment again. False when no path may carry it in time, or a copy that is under
  // way will be there sooner.
  bool repair(TimePoint now, MessageId id, std::uint16_t index,
              Evidence evidence = Evidence::kSilence);
  static std::size_t before_again(const Path& path, const Message& message);
  void queue_again(TimePoint now, Path& path, MessageId id, std::uint16_t index);
  // A copy of a fragment that is or could be under way.
  struct Copy {
    Path* path = nullptr;
    TimePoint arrival{};
  };
  std::optional<Copy> best_repair(TimePoint now, const Message& m, const Path* except);
  std::optional<Copy> soonest_copy(TimePoint now, MessageId id, std::uint16_t index,
                                   bool with_suspected);
  void settle(TimePoint now, LinkId link, std::span<const SentPackets::Settled> pieces,
              Evidence evidence = Evidence::kSilence);

  // A packet of so many bytes leaves: the next one may when the pace allows it.
  static void occupy(TimePoint now, Path& path, std::size_t ip_bytes);

  // --- repair symbols (sender_coding.cc)
  // What doubling the bytes of a message of usual importance is worth in messages lost: symbols are
  // added as long as a share x of the bytes saves more than x times this many. With 1 % of loss
  // that is five symbols for the last 60 of 98 pieces.
  static constexpr double kPriceOfBytes = 0.02;
  // What tells of a fragment, and the bytes of a fragment or symbol.
  static wire::FragmentHeader fragment_of(const Message& message, std::size_t index);
  static wire::MessageBytes::Part part_of(const Message& message, std::size_t index);
  // Whether what is queued or leaves on this path now could not be sent again in time if it is
  // lost.
  bool is_last(TimePoint now, const Path& path, const Message& message) const;
  // Whether symbols are in time if they wait for all of the message to leave.
  bool can_wait(TimePoint now, const Message& message);
  void note_leaving(TimePoint now, Path& path, Message& message, const JobQueue::Taken& taken);
  void lose(TimePoint now, Message& message, std::uint16_t index, Evidence evidence);
  // For what symbols are sent: for what is under way and last, or for all that is under way.
  enum class Protect : std::uint8_t { kLast, kAll };
  void protect(TimePoint now, Message& message, Protect what);
  bool makes_way(TimePoint now, const Message& message, Evidence evidence);
  void touch(const Message& message);
  void protect_touched(TimePoint now);
  static bool has_room(const Path& path, const Message& message);
  Path* symbol_path(TimePoint when, const Message& message, std::size_t bytes, TimePoint target);
  void add_symbols(TimePoint now, Message& message, Path& path, std::size_t block,
                   std::size_t count);

  // --- windows over small messages (sender_window.cc)
  std::size_t even_chunk(std::size_t bytes, std::size_t chunk, const Helpers& helpers) const;
  static std::optional<TimePoint> window_chance(LinkId link, const Path& path,
                                                const Message& message, TimePoint target,
                                                bool is_own);
  std::optional<TimePoint> window_latest(const Message& message, TimePoint target) const;
  bool join_window(TimePoint now, Message& message);
  Path* window_path(TimePoint now, std::span<Message* const> messages, LinkId& over);
  void send_window(TimePoint now);
  void add_window_symbol(LinkId over, const wire::WindowHeader& header, std::size_t longest,
                         TimePoint until);
  std::optional<Piece> take_window_symbol(TimePoint now, LinkId link, Path& path);

  // --- rescue (sender_rescue.cc)
  double chance_late(TimePoint now, const Path& path, const Message& message,
                     TimePoint target) const;
  std::optional<Copy> last_chance(const Message& message, const PathSet& over, const Path* except,
                                  std::size_t bytes, TimePoint target);
  bool rescued_for(TimePoint now, Message& message, TimePoint target);
  static std::vector<std::uint16_t> missing_on(Path& path, const Message& message);
  static std::size_t missing_bytes(const Message& message);
  void plan_rescue(TimePoint now, Message& message);
  void look_after(TimePoint now, Message& message);
  void rescue(TimePoint now, Path& path, Message& message);
  void begin_rescue(TimePoint now, Path& path, Message& message);

  // --- shares (sender_striping.cc)
  void enqueue(TimePoint now, Message& message, const std::vector<LinkId>& paths, bool divided);
  // Pieces for each of a message's paths, of which there are at most kMaxLinks.
  using Shares = std::array<std::uint16_t, kMaxLinks>;
  static std::size_t ip_bytes_of_piece(const Message& message);
  static Way way_of(const Path& path, const Message& message);
  static Duration queue_of(const Path& path, DataRate rate);
  static Duration time_to_bring(const Path& path, std::size_t ip_bytes);
  Shares shares(TimePoint now, const Message& message, const std::vector<LinkId>& paths) const;
  std::optional<LinkId> slower_path(LinkId link, const Path& path) const;
  bool take_over(TimePoint now, LinkId link, Path& path);
  bool together_can_arrive(TimePoint now, const Message& message) const;
  void note_brought(TimePoint now, LinkId link, Message& message, std::size_t index);
  void note_not_brought(TimePoint now, const Message& message);
  void learn(TimePoint now, const Message::Share& share);

  Options options_;
  FlatMap<LinkId, Path> paths_;
  MessageStore messages_;
  std::size_t bytes_ = 0;
  WindowFlow window_;
  Overdue overdue_;
  // When a path was removed last.
  TimePoint removed_at_ = TimePoint::min();
  // Above all numbers of packets of paths that were removed.
  std::uint64_t unused_number_ = 1;
  std::deque<MessageId> given_up_;
  // Payloads of messages that poll() has given up, of which it may have handed out pieces before.
  std::vector<Bytes> parting_;
  // Copies of pieces that do not lie in a payload as a whole, while symbols are made.
  Bytes scratch_;
  // Coded messages of which something was lost in the report that is taken in.
  std::vector<MessageId> touched_;
  std::uint32_t next_message_;
  std::uint64_t cancelled_ = 0;
};

}  // namespace interneuron::flow
