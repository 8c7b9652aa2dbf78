// The rate that one path delivers, for planning and pacing: the median of the last three trains,
// each measured at the receiver (train dispersion), so that one train compressed or stretched on
// its way changes nothing and a step is followed with the second train after it. Between trains,
// delivery rate samples may raise it. A train is trusted by how long it took to arrive: the
// receiver gives one time to all packets that it finds in one turn of its loop, so that a short
// train may look ten times as fast as its link.
//
// Trains count from 5 ms on, because the uplink of a cellular network is granted in bursts of 1 to
// 10 ms (docs/constants.md, "Rate of a link"); the fewer packets they have, the longer they must
// be. Delivery rate samples are those of draft-cheng-iccrg-delivery-rate-estimation-02.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/link/delivery_rate.h"
#include "core/link/windowed_minimum.h"
#include "interneuron/units.h"

namespace interneuron::link {

// A train as the receiver has measured it so far, and how it left here.
struct Train {
  // The number of its first packet.
  std::uint64_t id = 0;
  std::uint32_t packets = 0;
  // How many left from its first to its last packet, those included that were lost.
  std::uint32_t left = 0;
  // The bytes of all that left but the first, IP headers included, and the rate at which what
  // arrived of them did so.
  std::size_t bytes = 0;
  DataRate measured{};
  // The rate at which they left; nothing when they left back to back, faster than any link.
  std::optional<DataRate> sent_at;
  // The longest time within the train for which nothing was there to be sent.
  Duration pause{};
};

// Owned and fed by the LinkEstimator of the path. Trains are measured by the peer, who may report
// any rate: it then plans and paces what is sent to it wrongly. Pure; thread-compatible; constant
// memory.
class RateEstimator {
 public:
  static constexpr Duration kMinDispersion = std::chrono::milliseconds(5);
  // The dispersion of a train times its packets is this at least: three packets of a link of 0.5
  // Mbit/s are a train, and three that a radio held up for 10 ms are none. No measurement behind
  // this value: it only has to make one of few packets longer than delays vary within it.
  static constexpr Duration kMinPacketTime = std::chrono::milliseconds(40);
  // A train of fewer packets that is too short to trust says nothing at all.
  static constexpr std::uint32_t kMinTrainPackets = 16;
  // A train shorter than this may be no more than a batch that the receiver found at once: it tells
  // how fast to search, but no rate. No measurement behind this value: it only has to be larger
  // than a few turns of a busy loop.
  static constexpr Duration kLeastDispersion = std::chrono::milliseconds(1);
  // A train of so many packets counts however fast it was: at 100 Mbit/s the receiver would have to
  // be 7 ms late for the whole of it to be a batch. Such a train follows a first one that said
  // little, and both are all that a new path may send at once; without it nothing would be known of
  // fast links for a minute.
  static constexpr std::uint32_t kLongTrain = 60;
  // A train that arrived at more than this share of the rate that it was sent at was limited by us
  // and not by the link: trains are within ±15 % of the rate.
  static constexpr double kSenderLimited = 0.85;
  // The same where we paused within the train: the queue may have run empty meanwhile, and delays
  // that vary look like a slow link. No measurement behind this value: it only has to be so far
  // from 1 that variations of the delay do not reach it.
  static constexpr double kPausedLimited = 0.5;
  // The pace in terms of the rate.
  static constexpr double kHeadroom = 1.25;
  // The pace of the train after one that we limited, in terms of its rate: it measures a step up to
  // three times the rate.
  static constexpr double kSearchHeadroom = 3.0;

  // Neither the estimate nor the pace exceeds the cap.
  void set_cap(std::optional<DataRate> cap) { cap_ = cap; }

  // It may be told again as it grows. One shorter than kMinDispersion counts while no longer one is
  // known and if it has kMinTrainPackets, and one shorter than kLeastDispersion only for searching.
  void train(TimePoint now, const Train& train);
  // Raises the estimate where two of three samples are above it; never lowers it.
  void sample(TimePoint now, const DeliveryRate::Sample& sample);

  std::optional<DataRate> rate() const;
  // The rate, or what the shortest trains say while there is none: good enough to choose the next
  // train by, but not to plan messages with.
  std::optional<DataRate> guess() const;
  // The highest guess within the 10 s before the newest train or sample, and when that came.
  std::optional<DataRate> best() const;
  TimePoint guessed_at() const { return guessed_at_; }
  // How fast to send data, which is a train to the receiver; nothing while nothing is known. It may
  // change while a train is under way, because a train is judged by the rate at which it left.
  std::optional<DataRate> pace() const;
  // How many long trains the estimate rests on, at most three; 0 where it rests on none but those
  // that are too short to trust.
  std::size_t trains() const { return histories_[kStrong].count; }
  // The newest long train tells another rate than the median, and the one before it did not: the
  // rate may have made a step, which one more train would settle.
  bool disputed() const;
  // When the newest evidence came.
  std::optional<TimePoint> measured_at() const { return measured_at_; }

 private:
  static constexpr std::size_t kTrains = 3;
  // What is kept of a train: `shown` is the rate that it shows of the link.
  struct Seen {
    std::uint64_t id = 0;
    std::uint32_t packets = 0;
    DataRate shown{};
    bool limited_by_us = false;
    bool paced = false;
  };
  struct History {
    std::array<Seen, kTrains> trains{};
    std::size_t count = 0;
    // Replaces the newest train if that has the same id.
    void put(const Seen& train);
    // Forgets the newest train if that has this id.
    void drop(std::uint64_t id);
    DataRate median() const;
  };

  // How far a train is trusted.
  enum Grade : std::size_t { kGuess, kWeak, kStrong, kGrades };
  // Nothing when it says nothing.
  static std::optional<Grade> grade(const Train& train, DataRate shown);
  static bool paused(const Train& train);
  static bool limited_by_us(const Train& train);

  // The median of the most trusted trains there are, if their grade is at least `least`.
  std::optional<DataRate> raw(Grade least) const;
  std::optional<DataRate> capped(std::optional<DataRate> rate) const;
  void note_guess(TimePoint now);

  std::array<History, kGrades> histories_;
  // The newest train, whatever its grade.
  std::optional<Seen> newest_;
  std::array<DataRate, kTrains> samples_{};
  // What delivery rate samples since the newest train that counts show the link to carry at least.
  std::optional<DataRate> floor_;
  std::optional<DataRate> cap_;
  // The guesses of the last 10 s in bits per second, negated, and when the newest came.
  WindowedMinimum guesses_;
  TimePoint guessed_at_{};
  std::optional<TimePoint> measured_at_;
};

}  // namespace interneuron::link
