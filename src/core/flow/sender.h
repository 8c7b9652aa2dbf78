// The sending side of one peer: messages cut into pieces that fit the path (IP never fragments),
// earliest deadline first, paced per path; pieces found lost are sent again over the path that
// brings them soonest, while the deadline allows. Pure; thread-compatible; allocates per message,
// not per packet.
//
// In the order of use: send() queues a message on paths; poll() yields the next piece that may
// leave a path now; report() and handle_timeout() tell what arrived or must be taken for lost.
#pragma once

#include <bitset>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "core/base/ring.h"
#include "core/flow/sent_packets.h"
#include "core/wire/packet.h"
#include "interneuron/units.h"

namespace interneuron::flow {

// What the sender must know of a path; refreshed by set_path() whenever the estimates move.
struct PathView {
  bool up = true;                // else nothing is sent on it
  bool backup = false;           // repairs prefer the other paths
  std::optional<DataRate> rate;  // unknown: taken for kBlindRate
  std::optional<DataRate> pace;  // unknown: kBlindPace
  Duration one_way{};            // expected, zero while unknown
  // After this long without any acknowledgement what is in flight is lost.
  Duration probe_timeout{};
};

// Paths by LinkId.
using PathSet = std::bitset<256>;
inline const PathSet kEveryPath = PathSet{}.set();

class Sender {
 public:
  struct Options {
    bool repair = true;
    MessageId first_message{};
  };
  explicit Sender(Options options)
      : options_(options), next_message_(options.first_message.value) {}

  // A path that is known already only gets another size; its numbers go on.
  void add_path(LinkId path, std::size_t max_datagram, std::uint64_t first_number = 1);
  // Gives what it still owed to the other paths.
  void remove_path(TimePoint now, LinkId path);
  void set_path(LinkId path, const PathView& view);
  // Nothing more goes over this path until set_path() says that it is up again: what it owes and
  // what is in flight on it goes over the others at once, where that still helps.
  void pull(TimePoint now, LinkId path);

  // Queues a message (round header and payload) on these paths; what is lost of it is repaired over
  // these and those of `repairs` alone. After `deadline` nothing of it is
  // sent. Nothing is sent either of a message that does not fit into the number of pieces that the
  // wire allows.
  MessageId send(TimePoint now, TimePoint deadline, Duration lifetime, Bytes message,
                 const std::vector<LinkId>& paths, const PathSet& repairs = kEveryPath);

  // The next packet number of a path, for packets that the endpoint makes itself; they count as
  // sent. `train_bytes`: size at IP level of those that belong to trains, 0 of all others.
  std::uint64_t take_number(TimePoint now, LinkId path, std::size_t train_bytes = 0);

  // A piece of a message that may leave `path` now; the bytes are valid until the next call.
  // nullopt: nothing may.
  struct Piece {
    std::uint64_t number = 0;
    wire::FragmentHeader fragment;
    ByteView bytes;
  };
  std::optional<Piece> poll(TimePoint now, LinkId path);

  // `min_rtt`: of the path, for delivery rate samples.
  SentPackets::Verdicts report(TimePoint now, const wire::LinkReport& report,
                               Duration min_rtt = {});

  // Silence: packets older than their path's probe timeout count as lost. Drops what is past its
  // deadline.
  void handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const;
  // When poll() should be called for a path that has something queued; the paths that may not send
  // are the caller's business.
  std::optional<TimePoint> next_send(LinkId path) const;

  std::uint64_t resent(LinkId path) const;
  std::uint64_t lost(LinkId path) const;  // packets, by the peer's feedback or silence
  std::uint64_t cancelled() const { return cancelled_; }
  void reset(TimePoint now);  // the peer began a new life: everything queued or in flight is void

  // Before anything is known of a path; a start-up train measures it within a round trip. Chosen: a
  // weak 4G uplink.
  static constexpr DataRate kBlindRate{20'000'000};
  static constexpr DataRate kBlindPace{25'000'000};  // headroom as of a known rate

 private:
  struct Message {
    Bytes bytes;
    TimePoint deadline{};
    std::uint32_t lifetime_us = 0;
    std::uint16_t count = 0;
    std::uint16_t chunk = 0;
    std::uint16_t unacknowledged = 0;
    PathSet repairs;
    struct PieceState {
      bool acknowledged = false;
      std::uint8_t under_way = 0;  // copies queued or in flight
    };
    std::vector<PieceState> pieces;
  };
  // What a path still has to send of one message.
  struct Job {
    MessageId message{};
    TimePoint deadline{};
    std::uint32_t next = 0;  // first copies: next … count - 1
    std::uint16_t count = 0;
    std::uint16_t chunk = 0;
    Ring<std::uint16_t> again;
  };
  struct Path {
    std::size_t max_datagram = 0;
    PathView view;
    TimePoint free_at = TimePoint::min();  // pacing: when the next packet may leave
    std::vector<Job> jobs;                 // few: one per message under way
    SentPackets sent;
    std::uint64_t resent = 0;
  };

  std::optional<std::uint16_t> take_index(Job& job, bool& is_repair);
  Job* next_job(Path& path, TimePoint now);
  // What a path has to send before a piece that is queued now, of messages that somebody still
  // waits for.
  std::size_t queued_bytes(const Path& path) const;
  static std::vector<std::uint16_t> owed(const Job& job);
  static bool is_again(const Job& job, std::uint16_t index);
  // Whether it was queued on a path.
  bool repair(TimePoint now, MessageId id, std::uint16_t index);
  std::optional<TimePoint> expected_arrival(TimePoint now, MessageId id, std::uint16_t index) const;
  void settle(TimePoint now, std::span<const SentPackets::Settled> pieces);

  Options options_;
  std::map<LinkId, Path> paths_;
  std::unordered_map<MessageId, Message> messages_;
  std::uint32_t next_message_;
  std::uint64_t cancelled_ = 0;
};

}  // namespace interneuron::flow
