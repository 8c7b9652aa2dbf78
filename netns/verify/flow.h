// One flow of numbered datagrams, matched between its two ends. Pure; thread-compatible.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "netns/verify/readings.h"
#include "netns/verify/schedule.h"

namespace interneuron::cli::verify {

struct Flow {
  struct Packet {
    Duration sent{};
    std::size_t ip_bytes = 0;
    std::optional<Duration> arrived;  // the first copy; empty: lost
  };
  std::vector<Packet> packets;  // every number sent, in order
  std::size_t reordered = 0;    // arrived after one with a higher number (RFC 4737)
  std::size_t duplicates = 0;   // further copies
  std::size_t foreign = 0;      // number or stamp of no packet sent: corrupted on the way
};

// Which record of a packet says when it was sent. A capture at the sender's NIC is exact, but
// behind a qdisc (netem) it misses what that lost and sees the others only when they leave it; then
// iperf3's stamp tells, and gaps in the numbers tell what is missing.
enum class SentBy : std::uint8_t { kCapture, kStamp };

// All captures with times on one clock (`seen` and `stamp` alike), each in order of time. Packets
// that neither end saw are taken as sent evenly between their neighbours.
Flow match(const std::vector<Datagram>& at_sender, const std::vector<Datagram>& at_receiver,
           SentBy sent_by);

// Only packets sent in [from, to); the counts stay.
Flow trim(Flow flow, Duration from, Duration to);

struct Bursts {
  std::size_t count = 0;
  double mean = 0;  // packets
};
// Runs of packets lost one after the other, but for those in an outage (scheduled loss 1).
Bursts bursts(const Flow& flow, const Schedule& schedule, Direction direction);

// The mean length of such runs that a Gilbert-Elliott chain with `other` independent loss beside it
// makes in the long run, for a flow between whose packets others move the chain on as well:
// `others_per_packet` of them in the mean, at most 1.
double expected_burst(const emu::GilbertElliott& chain, double other, double others_per_packet);
// The standard deviation of the share of `packets` that is lost where `loss` of them are in the
// long run: by independent draws, or by a chain whose bursts make it vary more.
double chance_of_loss(double loss, const std::optional<emu::GilbertElliott>& chain,
                      std::size_t packets);

}  // namespace interneuron::cli::verify
