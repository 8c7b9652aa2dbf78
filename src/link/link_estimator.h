// What one endpoint believes of one path to one peer: round-trip times, delivery rate, loss,
// liveness; each from feedback, none from the peer's clock. Pure; thread-compatible; bounded
// memory.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include "interneuron/link.h"

namespace interneuron::link {

class LinkEstimator {
 public:
  // Round trips older than this say nothing of now: a radio's bad episodes begin within a second
  // (testbed.md §9).
  static constexpr Duration kQuantileWindow = std::chrono::seconds(2);
  static constexpr Duration kMinimumWindow = std::chrono::seconds(10);
  // A path is down when nothing was heard for this long. Heartbeats come every 50 ms, and the worst
  // delay of the paper's table (994 ms) may open a gap of half of it.
  static constexpr Duration kSilence = std::chrono::seconds(1);

  void heard(TimePoint now) { heard_at_ = now; }
  void round_trip(TimePoint now, Duration rtt);
  // Outcome of packets sent, in the order they became known.
  void acknowledged(std::uint64_t packets);
  void lost(std::uint64_t packets);
  // A train's dispersion as reported by the peer so far; `train` names it (its first packet). A
  // train that was sent no faster than the link could carry only bounds the rate from below:
  // `paced_at` is the rate we paced it at.
  void train(std::uint64_t train, std::uint32_t packets, DataRate measured,
             std::optional<DataRate> paced_at);

  LinkState state(TimePoint now) const;
  bool up(TimePoint now) const { return heard_at_ && now - *heard_at_ <= kSilence; }
  std::optional<DataRate> rate() const { return rate_; }
  // Half the smoothed round trip, for scheduling; zero while unknown.
  Duration one_way() const { return smoothed_ / 2; }
  // After this long without acknowledgement a packet is taken for lost.
  Duration probe_timeout() const;

 private:
  struct Sample {
    TimePoint at;
    Duration rtt;
  };
  void refresh(TimePoint now);
  void commit_train();

  std::optional<TimePoint> heard_at_;
  std::deque<Sample> samples_;  // of kMinimumWindow, oldest first
  Duration smoothed_{};
  Duration median_{};
  Duration p95_{};
  Duration min_{};
  double loss_ = 0;
  std::optional<DataRate> rate_;
  struct Train {
    std::uint64_t id = 0;
    DataRate measured{};
    std::optional<DataRate> paced_at;
  };
  std::optional<Train> open_train_;
  std::deque<DataRate> trains_;  // the last kTrains measured ones
};

}  // namespace interneuron::link
