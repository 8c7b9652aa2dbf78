// The properties of a link and of one direction of it, as values: the vocabulary that profiles,
// changes and back ends share. Sizes are in IP bytes, probabilities from 0 to 1. Pure.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/units.h"
#include "lab/emu/bottleneck.h"

namespace interneuron::emu {

// kUp: vehicle -> roadside, kDown: roadside -> vehicle.
enum class Direction : std::uint8_t { kUp, kDown };
inline constexpr std::size_t kDirections = 2;

// Loss in bursts (Gilbert 1960, Elliott 1963): a chain with a good and a bad state that makes a
// step per packet. In the good state a packet is lost with probability loss_in_good and the state
// turns bad with p; in the bad state these are loss_in_bad and r. With the defaults a burst has 1/r
// packets in the mean. In `netem loss gemodel p r 1-h 1-k`, 1-k is loss_in_good and 1-h
// loss_in_bad.
struct GilbertElliott {
  double p = 0;
  double r = 1;
  double loss_in_good = 0;
  double loss_in_bad = 1;
  // A stay in the bad state lasts for exactly so many packets, whatever r says; 0: as r says. For
  // experiments in virtual time: profiles have no key for it, and netem cannot do it.
  std::uint32_t exactly = 0;
  friend bool operator==(const GilbertElliott&, const GilbertElliott&) = default;
};

// One direction of a link as its profile describes it.
struct DirectionParams {
  // The rate of the bottleneck; with 0 or less nothing passes. Where there is a `trace`, the
  // trace's mean in the long run.
  DataRate rate{};
  // The most bytes and packets that may wait for the bottleneck, see LinkModel::enqueue(). With 0
  // packets only the bytes are limited.
  std::size_t queue_bytes = 0;
  std::size_t queue_packets = 0;
  // A rate that changes with time, in place of `rate`.
  std::optional<RateTrace> trace{};
  // Drops what does not conform, in front of the queue.
  TokenBucketParams police{};
  // Lets what does not conform wait behind the bottleneck, which holds up the queue: so bursts pass
  // at `rate` and the rest at that of the bucket.
  TokenBucketParams shape{};
  // The uplink of a radio is granted from time to time: packets leave during grant_share of each
  // such period alone, at `rate` / grant_share, so that `rate` is the mean. 0: at any time. Where
  // there is a trace, that is all there is.
  Duration grant_every{};
  double grant_share = kGrantShare;
  // A radio sends again what it finds damaged, which takes harq_by each time, up to kHarqTries
  // times, and hands on in order: with this probability each time a packet is late by that, and so
  // are those behind it.
  double harq = 0;
  Duration harq_by = kHarqBy;
  // A radio that has carried nothing in either direction for wake_after sleeps, and what comes then
  // waits for wake_by. 0: it never sleeps.
  Duration wake_after = kWakeAfter;
  Duration wake_by{};
  // The following are probabilities per packet. `loss` takes the place of the radio state's;
  // gilbert_elliott is a further cause of loss.
  std::optional<double> loss{};
  std::optional<GilbertElliott> gilbert_elliott{};
  double duplicate = 0;
  // One bit of the packet is flipped; the receiver's checksum then drops it.
  double corrupt = 0;
  // The packet arrives reorder_by earlier than in order, but not before it has left the bottleneck.
  // netem's `reorder` is the case in which reorder_by is the whole delay.
  double reorder = 0;
  Duration reorder_by = kWholeDelay;
  // Larger packets are lost without an error (a path MTU black hole); 0: there is no limit.
  std::size_t mtu = 0;

  // Longer than any delay.
  static constexpr Duration kWholeDelay = std::chrono::minutes(1);
  // One subframe of LTE of each five.
  static constexpr double kGrantShare = 0.2;
  // The round trip of LTE's hybrid ARQ, eight subframes of 1 ms, and how often it sends again at
  // most, as networks are usually set.
  static constexpr Duration kHarqBy = std::chrono::milliseconds(8);
  static constexpr int kHarqTries = 3;
  // Networks let a radio go after some 10 s without traffic (Huang et al., A Close Examination of
  // Performance and Power Characteristics of 4G LTE Networks, 2012: 11.6 s).
  static constexpr Duration kWakeAfter = std::chrono::seconds(10);
};

// What carrier-grade NATs and tunnels are known to do to packets. 0 turns each off.
struct NatParams {
  // Smaller packets are dropped.
  std::size_t drop_below = 0;
  // A packet larger than reorder_above arrives reorder_delay late with probability `reorder`, so
  // that others overtake it.
  std::size_t reorder_above = 0;
  double reorder = 0;
  Duration reorder_delay{};
  // Packets down are dropped when no packet has gone up for this long, or none ever.
  Duration idle_timeout{};
};

// Outages of `length` at `first` and then after every `every`. With every 0 there is one outage,
// with length 0 there is none.
struct PeriodicOutage {
  Duration first{};
  Duration length{};
  Duration every{};
};

// The properties of one direction at one instant, for a back end that can only set parameters.
struct Conditions {
  // Half the round trip, without waiting for the bottleneck.
  Duration one_way{};
  // Without the loss of gilbert_elliott. 1 in an outage.
  double loss = 0;
  std::optional<GilbertElliott> gilbert_elliott{};
  // That of a trace is its mean over the next kConditionsSpan.
  DataRate rate{};
  // As in DirectionParams.
  std::size_t queue_bytes = 0;
  std::size_t queue_packets = 0;
  double duplicate = 0;
  double corrupt = 0;
  double reorder = 0;
  // At most one_way.
  Duration reorder_by{};
  // As in DirectionParams.
  std::size_t mtu = 0;
};

// The span over which Conditions have one rate. A change of netem takes 10 us (docs/constants.md,
// "The testbed on a machine"), so that 50 changes a second of each NIC cost next to nothing.
inline constexpr Duration kConditionsSpan = std::chrono::milliseconds(20);

}  // namespace interneuron::emu
