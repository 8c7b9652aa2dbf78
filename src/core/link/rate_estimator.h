// The rate that one path delivers, for planning and pacing: the median of the last three trains,
// each measured at the receiver (train dispersion), so that one train compressed or stretched on
// its way moves nothing and a step is followed by the second one after it. Where no train is there,
// delivery rate samples bound it from below. A train is trusted by how long it took to arrive: the
// receiver stamps what it finds in one turn of its loop alike, so that a short train may look ten
// times as fast as its link. Pure; thread-compatible; constant memory.
//
// Trains count from 16 packets and 5 ms on, because the uplink of a cellular network is granted in
// bursts of 1 to 10 ms (docs/constants.md, "Rate of a link"). Delivery rate samples are those of
// draft-cheng-iccrg-delivery-rate-estimation-02.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/link/delivery_rate.h"
#include "interneuron/units.h"

namespace interneuron::link {

class RateEstimator {
 public:
  static constexpr std::uint32_t kMinTrainPackets = 16;
  static constexpr Duration kMinDispersion = std::chrono::milliseconds(5);
  // A shorter one may be no more than a batch that the receiver found at once: it tells how fast to
  // search, but no rate. Ten turns of a busy loop; chosen.
  static constexpr Duration kLeastDispersion = std::chrono::milliseconds(1);
  // One of so many packets counts however fast it was: at 100 Mbit/s the receiver would have to be
  // 7 ms late for the whole of it to be a batch. Such a train follows a first one that said little
  // and is all that a new path may use at once; else nothing would be known of fast links for a
  // minute; chosen.
  static constexpr std::uint32_t kLongTrain = 60;
  // A train that arrived at this share of the rate it was sent at was limited by us; chosen.
  static constexpr double kSenderLimited = 0.85;
  static constexpr double kHeadroom = 1.25;
  // Pacing of the train after one that we limited: a step to three times the rate is measured by
  // it; chosen.
  static constexpr double kSearchHeadroom = 3.0;

  // Neither the estimate nor the pace exceeds the cap.
  void set_cap(std::optional<DataRate> cap) { cap_ = cap; }

  // A train as the receiver has measured it so far; may be told again as it grows, `id` names it
  // (its first packet). `sent_at`: the rate at which these packets left; nothing: back to back,
  // faster than any link. Fewer than kMinTrainPackets say nothing; a train shorter than
  // kMinDispersion counts while no longer one is known, one shorter than kLeastDispersion for
  // searching only.
  void train(TimePoint now, std::uint64_t id, std::uint32_t packets, DataRate measured,
             std::optional<DataRate> sent_at);
  // Raises the estimate where two of three samples are above it; never lowers it.
  void sample(TimePoint now, const DeliveryRate::Sample& sample);

  std::optional<DataRate> rate() const;
  // The rate, or what the shortest trains say while there is none: to choose the next train by, not
  // to plan with.
  std::optional<DataRate> guess() const;
  // How fast to send the next train; nothing while nothing is known. May change while one is
  // under way: a train is judged by the rate at which it left, whatever was wanted.
  std::optional<DataRate> pace() const;
  // The estimate rests on trains that are too short to trust.
  bool weak() const { return trains() == 0; }
  std::size_t trains() const {
    return histories_[kStrong].count;
  }  // long ones that the estimate rests on
  // The newest long train tells another rate than the median, and the one before it did not: the
  // rate may have made a step, which one more train would settle.
  bool disputed() const;
  // When the newest evidence came.
  std::optional<TimePoint> measured_at() const { return measured_at_; }

 private:
  static constexpr std::size_t kTrains = 3;
  struct Train {
    std::uint64_t id = 0;
    std::uint32_t packets = 0;
    DataRate measured{};
    bool limited_by_us = false;
    bool paced = false;
  };
  struct History {
    std::array<Train, kTrains> trains{};
    std::size_t count = 0;
    void put(const Train& train);  // replaces the newest if that has the same id
    void drop(std::uint64_t id);   // the newest, if it has this id
    DataRate median() const;
  };

  // How far a train is trusted.
  enum Grade : std::size_t { kGuess, kWeak, kStrong, kGrades };
  static Grade grade(std::uint32_t packets, DataRate measured, DataRate shown);

  // Of the trains that are trusted most, if they are trusted that much.
  std::optional<DataRate> raw(Grade least) const;
  std::optional<DataRate> capped(std::optional<DataRate> rate) const;

  std::array<History, kGrades> histories_;
  std::optional<Train> newest_;  // whatever it says
  std::array<DataRate, kTrains> samples_{};
  std::optional<DataRate> floor_;  // of delivery rate samples, since the last long train
  std::optional<DataRate> cap_;
  std::optional<TimePoint> measured_at_;
};

}  // namespace interneuron::link
