// One flow of iperf3's numbered datagrams, matched between the captures of its two ends: which
// were lost, late, reordered, duplicated or corrupted; and the statistics of loss bursts.
//
// Pure; thread-compatible. Memory is linear in the highest number, which is bounded: a corrupted
// record cannot make it larger than 10^8. No errors: records that fit nowhere are counted.
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
    // When the first copy arrived; empty when the packet was lost.
    std::optional<Duration> arrived;
  };
  // One for every number sent, in the order of the numbers.
  std::vector<Packet> packets;
  // Packets that arrived after one with a higher number (RFC 4737).
  std::size_t reordered = 0;
  // Copies after the first.
  std::size_t duplicates = 0;
  // Records whose number or stamp is of no packet sent: they were corrupted on the way.
  std::size_t foreign = 0;
};

// Which record of a packet says when it was sent.
// kCapture: the one at the sender's NIC, which is exact where the emulator drives the link.
// kStamp: the time that iperf3 wrote into the payload, for links driven by netem. There the capture
// lies behind the queueing discipline: it misses packets that were lost and sees the others only
// when they leave. Gaps in the numbers then tell what is missing.
enum class SentBy : std::uint8_t { kCapture, kStamp };

// Matches both captures by number. Both must be in order of time, and `seen` and `stamp` of both
// must be of one clock. Packets that neither end saw get send times spread evenly between those of
// their neighbours.
Flow match(const std::vector<Datagram>& at_sender, const std::vector<Datagram>& at_receiver,
           SentBy sent_by);

// Keeps only the packets sent in [from, to); the counts of reordered, duplicated and foreign
// records still cover the whole flow.
Flow trim(Flow flow, Duration from, Duration to);

struct Bursts {
  std::size_t count = 0;
  // The mean length, in packets.
  double mean = 0;
};
// Runs of consecutive lost packets. Packets sent in an outage (scheduled loss 1) do not count: they
// are lost whatever the chain does.
Bursts bursts(const Flow& flow, const Schedule& schedule, Direction direction);

// The mean length, in packets, of the loss runs that a Gilbert-Elliott chain makes in the long run.
// `other` is an independent loss probability beside the chain's. `others_per_packet` is the mean
// number of packets of other flows between two of this flow (at most 1): each moves the chain on
// by one step as well, which makes this flow's runs shorter.
double expected_burst(const emu::GilbertElliott& chain, double other, double others_per_packet);
// The standard deviation of the measured share of lost packets among `packets`, where in the long
// run the share `loss` is lost: by independent draws, or by `chain`, whose bursts make the share
// vary more.
double chance_of_loss(double loss, const std::optional<emu::GilbertElliott>& chain,
                      std::size_t packets);

}  // namespace interneuron::cli::verify
