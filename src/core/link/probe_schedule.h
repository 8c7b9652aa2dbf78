// When one path is measured although nothing else is sent on it: heartbeats (feedback packets with
// a clock exchange), rate trains, and single data-sized packets that prove delivery. Decides only;
// the endpoint makes and sends the packets. Pure; thread-compatible; constant memory.
//
// Budgets, IP headers included: heartbeats at most kHeartbeatRate per direction, trains and proofs
// at most kTrainRate on average. Trains that a withheld variant asks for have a budget of their
// own: at most kWantedShare of the believed rate and kWantedRate, and almost nothing once kPatience
// of them have found no higher rate. A train leaves only once the one before has been told of, or
// is lost: else the first ones fill the queue of a slow link for a minute. While messages flow that
// need little of what the path is believed to carry, nothing but a request makes a train: whatever
// more it found would help no message, and where many senders share a cell their trains together
// would fill it.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/sizes.h"
#include "interneuron/units.h"

namespace interneuron::link {

// Says when heartbeats, trains and proofs are due on one path. Path (src/core/peers) tells it what
// happened, asks what is due, and reports what it has sent. Nothing in it comes from the peer but
// the rate evidence, with which a lying peer can only make us send longer trains to itself, within
// the budgets, which hold whatever it says.
class ProbeSchedule {
 public:
  // While messages flow, a path's round trip is refreshed this often: two samples per round at 10
  // Hz.
  static constexpr Duration kActiveHeartbeat = std::chrono::milliseconds(50);
  static constexpr Duration kIdleHeartbeat = std::chrono::milliseconds(300);
  // UDP mappings of carriers' address translation may end after 15 s (docs/constants.md, "Silence
  // and address translation").
  static constexpr Duration kMeteredHeartbeat = std::chrono::seconds(12);
  // The active pace goes on for so long after the last message. No measurement behind this value:
  // it only has to be larger than the pauses of an application that is in use.
  static constexpr Duration kActive = std::chrono::seconds(5);
  // A new path that nobody uses yet is measured at this pace for so long: its 600 packets tell 1 %
  // loss from 3 %. Slower than the active pace, because the other side's trains are answered with
  // feedback as well: 25 kbit/s leave a sixth of what an idle path may cost for that.
  static constexpr Duration kNewHeartbeat = std::chrono::milliseconds(60);
  static constexpr Duration kNew = std::chrono::seconds(36);
  // A heartbeat about one path has 186 bytes with its IP header, which are 29 kbit/s every 51 ms;
  // with the feedback on trains it stays below 30.
  static constexpr DataRate kHeartbeatRate{29'000};
  // Nor do they take more than this share of a slow path, as far as the idle pace allows: messages
  // need the rest. No measurement behind this value; at 1.45 Mbit/s it is kHeartbeatRate.
  static constexpr double kHeartbeatShare = 0.02;
  // With the start budget and a last train that is not paid for yet, the mean of ten minutes stays
  // within 150 kbit/s, the aim for idle links.
  static constexpr DataRate kTrainRate{145'000};
  // What wanted trains may use: a train of 16 ms every 320 ms, so that three or four of them, which
  // show a link that is back at nine times its rate, leave within 1.5 s. No measurement behind
  // these values: they only have to be small beside the messages that wait for the result.
  static constexpr double kWantedShare = 0.05;
  static constexpr DataRate kWantedRate{1'000'000};
  // Wanted trains that find nothing before their interval begins to double: 10 s of them.
  static constexpr int kPatience = 30;

  // What is known of the rate; from the RateEstimator.
  struct RateEvidence {
    std::optional<DataRate> rate;
    // When it was measured; nothing while `rate` is only a guess.
    std::optional<TimePoint> at;
    // Long trains that it rests on.
    std::size_t trains = 0;
  };
  struct Train {
    std::uint32_t packets = 0;
    // How fast the packets leave; nothing: back to back.
    std::optional<DataRate> pace;
  };

  // The rate at which the newest messages to this peer, on whatever path, are sent early enough;
  // zero: nothing is known of any.
  void set_needed(DataRate needed) { needed_ = needed; }
  // The slower of the path's two directions. Both ends must name the same, because each expects to
  // hear the other as often as it sends itself; zero: not known.
  void set_slower(DataRate slower) { slower_ = slower; }
  // A metered path gets no trains unless asked, and few heartbeats while idle.
  void set_metered(bool metered) { metered_ = metered; }
  // Size of a heartbeat and of a full packet at IP level, bytes.
  void set_sizes(std::size_t heartbeat, std::size_t full);
  void set_rate(const RateEvidence& evidence) { evidence_ = evidence; }
  // The path is kLatched: data-sized packets must prove that it delivers.
  void set_latched(bool latched) { latched_ = latched; }
  // Trains make sense: the peer has echoed us and the path is usable.
  void set_ready(bool ready) { ready_ = ready; }
  void request_train(TimePoint now);
  // A better variant would have been sent on this path if it carried `rate`, which it is not
  // believed to do. Repeat it with every such message.
  void want(TimePoint now, DataRate rate);

  // --- what happened
  // A message of ours or for us is under way, on any path.
  void active(TimePoint now);
  // A fragment of a message left on this path.
  void data_sent(TimePoint now);
  // A feedback packet left on this path, for whatever reason.
  void heartbeat_sent(TimePoint now);
  void train_sent(TimePoint now, std::uint32_t packets);
  // The peer has told of the end of the newest train, or of what was sent after it.
  void train_told() { awaits_train_ = false; }
  void proof_sent(TimePoint now);

  // --- what is due
  Duration heartbeat_interval(TimePoint now) const;
  TimePoint heartbeat_at(TimePoint now) const;
  // One may leave now; a little before heartbeat_at() already, where something else wakes us up.
  bool heartbeat_due(TimePoint now) const;
  // A train that should be sent now; ask again only after train_sent().
  std::optional<Train> train_due(TimePoint now) const;
  bool proof_due(TimePoint now) const;
  TimePoint next_timeout(TimePoint now) const;

 private:
  bool is_wanted(TimePoint now) const;
  bool is_plenty(TimePoint now) const;
  // The pace and the length of the next train; the rate must be known for the first.
  DataRate train_pace(TimePoint now) const;
  std::uint32_t train_packets(TimePoint now) const;
  // What trains and proofs may use now, in bits: the level of a token bucket.
  double level(TimePoint now, double train) const;
  TimePoint in_a_pause(TimePoint now, TimePoint at) const;
  TimePoint next_train() const;
  std::optional<TimePoint> usual_train_wish(TimePoint now) const;
  std::optional<TimePoint> usual_train_at(TimePoint now) const;
  std::optional<TimePoint> wanted_train_at(TimePoint now) const;
  std::optional<TimePoint> train_before(TimePoint now, TimePoint end) const;
  double bits(std::uint32_t packets) const;
  void spend(TimePoint now, std::uint32_t packets);
  std::optional<TimePoint> proof_time(TimePoint now) const;

  bool metered_ = false;
  bool latched_ = false;
  bool ready_ = false;
  std::size_t heartbeat_bytes_ = 152;
  std::size_t full_bytes_ = kMaxPacketBytes;
  RateEvidence evidence_;
  DataRate needed_{};
  DataRate slower_{};
  // When active() or heartbeat_sent() was first called.
  std::optional<TimePoint> begun_at_;
  std::optional<TimePoint> requested_at_;
  std::optional<TimePoint> active_at_;
  std::optional<TimePoint> data_at_;
  // The end of the last pause between messages.
  TimePoint paused_at_{};
  std::optional<TimePoint> heartbeat_at_;
  std::optional<TimePoint> train_at_;
  // Packets of the newest train.
  std::uint32_t last_train_ = 0;
  // Its end has not been told of.
  bool awaits_train_ = false;
  // The newest want(), when the budget allows the next wanted train, the rate believed when the
  // last one left, and how many in a row have found no higher one.
  std::optional<TimePoint> wanted_at_;
  DataRate wanted_rate_{};
  TimePoint wanted_next_ = TimePoint::min();
  DataRate wanted_from_{};
  int fruitless_ = 0;
  std::optional<TimePoint> proof_at_;
  double level_ = 0;
  std::optional<TimePoint> level_at_;
};

}  // namespace interneuron::link
