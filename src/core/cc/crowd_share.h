// The share of a bottleneck that others use as well: a rate that is kept in the mean, however the
// traffic comes in bursts.
//
// A camera sends a frame every 100 ms and nothing in between. Held to its fair share a frame would
// take longer in a crowded cell than its deadline, and sent at once fifty of them would stand in
// the queue. So the share is a token bucket: what was not used of it is saved up, and a message for
// which enough is saved leaves within a third of its time. A message that finds too little gives
// way to its smallest variant or is refused, which saves for the next one. Everyone takes turns by
// savings of its own, which needs neither agreement nor balance; how much has to be saved varies,
// or all would send at once who began at once.
//
// The rate follows the mean queue of the last few round trips, of which all see the same. Who has
// less bears a longer one: at a queue that everybody sees the small share grows and the large one
// shrinks until they are equal, as in Swift (Kumar et al., Swift: Delay is Simple and Effective for
// Congestion Control in the Datacenter, 2020).
//
// Others are found by what they add to the queue (QueueOfOthers): on less evidence in the first two
// seconds of a path's messages, since a crowd that is found late has filled the queue by then.
// Where the queue stays long although we give way, others give way to nobody: the rate is that of
// CompetingRate then, until the queue is gone.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "core/cc/competing_rate.h"
#include "core/cc/newcomer.h"
#include "core/cc/queue_of_others.h"
#include "interneuron/units.h"

namespace interneuron::cc {

// Owned and fed by the ShareControl of the path. Constant memory. Pure; thread-compatible; never
// throws.
class CrowdShare {
 public:
  // `seed`: differs between those who may share a bottleneck.
  explicit CrowdShare(std::uint64_t seed = 0) : random_(seed) {}

  // What trains show of the pipe. Among those of others they show less, which is no news.
  void set_capacity(DataRate capacity) {
    capacity_ = is_crowded() ? std::max(capacity_, capacity) : capacity;
  }
  DataRate capacity() const { return capacity_; }
  // Bytes with IP headers left.
  void sent(TimePoint now, std::size_t ip_bytes);
  // A message is to be sent, whose best and smallest variants have so many bytes, and so long to
  // leave and to wait in queues. `least_round_trip`: see Newcomer::asked().
  void asked(TimePoint now, std::size_t best, std::size_t smallest, Duration left,
             Duration least_round_trip = {});
  // See Newcomer.
  void told() { newcomer_.told(); }
  void train_waited(Duration beyond) { newcomer_.train_waited(beyond); }
  // A packet that left at `left_at` waited for so long.
  void met(TimePoint now, TimePoint left_at, Duration waited);
  // A train arrived more slowly than it left and than the pipe carries.
  void stretched(TimePoint now) { stretched_at_ = now; }
  void clock_stepped() { queue_.clock_stepped(); }
  // Packets of ours were lost or marked.
  void lost(TimePoint now, std::uint32_t packets, Duration round_trip) {
    if (competes_) competing_.lost(now, packets, round_trip);
  }
  // Finds out whether others are there, and adapts the rate where that is due.
  void decide(TimePoint now, Duration round_trip);

  // Others are there. While they are, the rest counts.
  bool is_crowded() const { return rate_.has_value(); }
  // Nobody was found yet, and the best variant of the newest message is not to be sent.
  bool is_held_low() const { return !rate_ && !granted_ && smallest_ > DataRate{}; }
  // And they give way to nobody.
  bool competes() const { return is_crowded() && competes_; }
  // It has been watched for a while, and no packet of others was met lately.
  bool is_alone(TimePoint now) const;
  // The share in the mean.
  DataRate rate() const { return *rate_; }
  // The rate that brings the smallest variant of the newest message in time.
  DataRate smallest() const { return smallest_; }
  // The rate at which the newest message would be sent.
  DataRate planned() const {
    return std::min(std::max(*rate_, granted_ ? best_ : smallest_), capacity_);
  }
  // What a packet is expected to wait for: the longer of the newest queue and the mean
  // one.
  Duration waited() const;

 private:
  double saved(TimePoint now) const;
  double used(TimePoint now) const;
  static double target(DataRate rate);
  DataRate least() const;
  void vary();
  void note_period(TimePoint now, Duration left);
  bool finds_others(TimePoint now);
  bool suspects_others(TimePoint now) const;
  bool is_stretched(TimePoint now) const;
  bool is_doubtful(TimePoint now) const;
  void enter(TimePoint now);
  DataRate wanted() const;
  void compete(TimePoint now);
  void answer_stubborn(TimePoint now);
  bool is_in_vain(TimePoint now) const;
  void adapt(TimePoint now);
  void fall(TimePoint now, double over);

  DataRate capacity_{};
  // What it was before trains were stretched.
  DataRate before_others_{};
  QueueOfOthers queue_;
  std::optional<DataRate> rate_;
  // While the path is new, less evidence convicts.
  Newcomer newcomer_;
  // The newest message: the bytes of its best variant, what brings that and the smallest
  // variant in time (zero where there is no smaller one), and whether the best one may
  // be sent: in a crowd, where enough was saved up for it.
  double asked_ = 0;
  DataRate best_{};
  DataRate smallest_{};
  bool granted_ = false;
  // The seconds between two messages, smoothed, and when the newest one came.
  double period_ = 1;
  std::optional<TimePoint> asked_at_;
  // The share that the smallest variants take.
  DataRate floor_{};
  // Bytes that are saved up, when they were counted, and how much must be saved for a
  // message, in terms of its size.
  double saved_ = 0;
  TimePoint saved_at_{};
  double threshold_ = 1;
  // The state of next_split_mix().
  std::uint64_t random_ = 0;
  // What is sent in the mean, in bytes per second.
  double used_ = 0;
  std::optional<TimePoint> used_at_;
  std::optional<TimePoint> stretched_at_;
  // When the capacity became known, others were last seen, and the share became one.
  std::optional<TimePoint> began_at_;
  std::optional<TimePoint> others_at_;
  std::optional<TimePoint> entered_at_;
  // When the queue was last as short as is aimed at or, where others give way to nobody,
  // when there last was one.
  TimePoint queue_told_at_{};
  // When our share was last one, in a queue as short as is aimed at, and until when no
  // share is taken at all.
  TimePoint shared_at_{};
  TimePoint ignored_until_ = TimePoint::min();
  // Others give way to nobody, and for how long that is remembered of those who come
  // next.
  bool competes_ = false;
  TimePoint competes_until_ = TimePoint::min();
  CompetingRate competing_;
  // The longest queue since the last decision, and that before it.
  double longest_ = 0;
  double before_ = 0;
  TimePoint decide_at_ = TimePoint::min();
  TimePoint fall_at_ = TimePoint::min();
};

}  // namespace interneuron::cc
