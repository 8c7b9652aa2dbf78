// What one endpoint believes of one path to one peer: round-trip times, queue, rate, loss and
// whether it works; each from feedback, none from the peer's clock. Joins the machines of this
// folder for one path; the ProbeSchedule is beside it. Pure; thread-compatible; bounded memory; no
// allocation per packet.
//
// For each feedback on the path, call in this order: heard(), round_trip() and one_way_delays() of
// its exchange, then arrived() / lost() per run in the order of packet numbers, delivered() once,
// train() once, peer_sees() once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/link/delivery_rate.h"
#include "core/link/estimators.h"
#include "core/link/path_machine.h"
#include "core/link/policed_rate.h"
#include "core/link/probe_schedule.h"
#include "core/link/rate_estimator.h"
#include "interneuron/link.h"

namespace interneuron::link {

// Owned by the Path that it describes (src/core/peers/path.h). What a peer reports (round trips,
// rates, losses, acknowledgements) is taken at its word within the ranges that each machine allows:
// a lying peer spoils the estimates of its own paths and no others.
class LinkEstimator {
 public:
  // --- settings
  void set_traits(const LinkTraits& traits);
  // How long the peer is silent on this path at the longest when nothing else is sent.
  void set_heartbeat(TimePoint now, Duration heartbeat);
  // For how long the peer may hold back its feedback because its way back is slow.
  void set_feedback_spacing(TimePoint now, Duration spacing);
  // No other path to this peer is usable.
  void set_last_usable(bool last) { machine_.set_last_usable(last); }

  // --- inputs
  void sent(TimePoint now, bool data) { machine_.sent(now, data); }
  void heard(TimePoint now);
  void round_trip(TimePoint now, Duration rtt);
  // One-way delays of a clock exchange, up = (u - h) - s and down = r - u, both with the clock
  // offset in them (docs/paper.md, "Clock offset").
  void one_way_delays(TimePoint now, Duration up, Duration down);
  void clock_stepped();
  // What became of packets that were sent: runs of equal outcome, in the order of packet numbers.
  void arrived(TimePoint now, std::uint64_t packets) { loss_.arrived(now, packets); }
  void lost(TimePoint now, std::uint64_t packets) { loss_.lost(now, packets); }
  // See PathMachine::delivered().
  void delivered(TimePoint now, TimePoint sent_at, bool data);
  // See RateEstimator::train().
  void train(TimePoint now, const Train& train) { rate_.train(now, train); }
  // See PolicedRate::passed().
  void passed(TimePoint now, std::span<const Passage> packets);
  void delivery_sample(TimePoint now, const DeliveryRate::Sample& sample);
  Duration feedback_spacing() const { return feedback_spacing_; }
  // What the peer believes of its own direction: its rate and the share of its packets lost.
  void peer_sees(DataRate rate_down, double loss_down);
  void removed(TimePoint now) { machine_.removed(now); }
  void handle_timeout(TimePoint now);

  // --- outputs
  LinkState state(TimePoint now) const;
  // Whether messages may be sent: the path is usable, and the operator does not forbid it.
  bool up() const { return machine_.usable() && traits_.role != LinkRole::kNever; }
  PathState path() const { return machine_.state(); }
  double share(TimePoint now) const { return machine_.share(now); }
  std::optional<PathMachine::Change> poll_change() { return machine_.poll_change(); }
  std::optional<TimePoint> next_timeout() const { return machine_.next_timeout(); }
  std::optional<DataRate> rate() const { return rate_.rate(); }
  // The slower of the rates of both directions that were measured, one of them by the peer; zero:
  // of none. The peer knows it as well, but for what is just being told.
  DataRate slower_rate() const;
  // What the peer believes of its own direction; zero: nothing.
  DataRate rate_down() const { return rate_down_; }
  // See RateEstimator::best() and guessed_at().
  std::optional<DataRate> best_rate() const { return rate_.best(); }
  TimePoint guessed_at() const { return rate_.guessed_at(); }
  // See RateEstimator::guess().
  std::optional<DataRate> rate_guess() const { return rate_.guess(); }
  // The most that the operator and a policer on the way allow; nothing: they allow anything.
  std::optional<DataRate> cap() const;
  std::optional<DataRate> pace() const { return rate_.pace(); }
  double loss() const { return loss_.loss(); }
  Duration jitter() const { return rtt_.variation(); }
  double loss_burst() const { return loss_.burst(); }
  double loss_burst_deviation() const { return loss_.burst_deviation(); }
  double quick_loss() const { return loss_.quick_loss(); }
  double quick_loss_packets() const { return loss_.quick_packets(); }
  ProbeSchedule::RateEvidence rate_evidence() const;
  // Half the round trip, smoothed with a short memory, to plan with; zero while unknown.
  Duration one_way() const { return rtt_.quick() / 2; }
  Duration rtt_min(TimePoint now) const { return rtt_.minimum(now); }
  // After this long without acknowledgement a packet is taken for lost.
  Duration probe_timeout(TimePoint now) const;

 private:
  void refresh_pace(TimePoint now);

  LinkTraits traits_;
  Duration heartbeat_ = ProbeSchedule::kIdleHeartbeat;
  Duration feedback_spacing_{};
  std::optional<TimePoint> heard_at_;
  RttEstimator rtt_;
  QueueSignal queue_up_;
  QueueSignal queue_down_;
  LossEstimator loss_;
  RateEstimator rate_;
  PolicedRate policed_;
  PathMachine machine_;
  DataRate rate_down_{};
  double loss_down_ = 0;
};

}  // namespace interneuron::link
