// Reads what the measuring tools wrote: parses ping's lines, tcpdump's captures of iperf3's
// datagrams and tcpdump's last report; and matches the captures of a flow's two ends, which tells
// which datagrams were lost, late, reordered, duplicated or corrupted, and how losses burst.
//
// iperf3 (3.12, 32-bit counters) begins each UDP payload with 12 bytes in network order: seconds
// and microseconds of CLOCK_MONOTONIC before the sending call, and a number that counts from 1.
//
// The bytes may be anything (the emulator corrupts packets on purpose): every length is checked
// before it is used, and whatever does not parse is skipped or counted. Memory is linear in the
// input and in the highest number of a flow, which is bounded: a corrupted record cannot make it
// larger than 10^8. Pure; thread-compatible; never throws.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "interneuron/time.h"
#include "netns/verify/schedule.h"

namespace interneuron::netns::verify {

// One answered echo request, by its first answer.
struct Ping {
  std::uint32_t sequence = 0;
  // By the wall clock as parsed; session.cc moves it to the time of the links.
  Duration sent{};
  Duration round_trip{};
};

struct PingLog {
  // In the order in which the answers arrived.
  std::vector<Ping> answered;
  // From ping's summary; 0 when it was killed before it wrote one.
  std::size_t transmitted = 0;
};

// Reads the output of `ping -D`. It prints the wall clock at which an answer arrived; the time of
// sending is that minus the round-trip time.
PingLog parse_ping(std::string_view text);

// One datagram of iperf3 as tcpdump saw it.
struct Datagram {
  // When tcpdump saw it: by the wall clock as parsed; session.cc moves it to the time of the links.
  Duration seen{};
  std::uint16_t from_port = 0;
  std::uint16_t to_port = 0;
  // The total length from the IP header, although less of it may have been captured.
  std::size_t ip_bytes = 0;
  std::uint32_t number = 0;
  // When iperf3 sent it: of CLOCK_MONOTONIC as parsed, then moved like `seen`.
  Duration stamp{};
};

// tcpdump must capture this many bytes of each frame: 14 of Ethernet, 20 of IPv4, 8 of UDP and 12
// of iperf3 are 54.
inline constexpr int kCaptureBytes = 64;

// Reads a pcap file of Ethernet frames; nullopt when `bytes` is no such file. A record that is cut
// off at the end is skipped, as is every frame that is not IPv4 with iperf3's payload.
std::optional<std::vector<Datagram>> parse_capture(std::string_view bytes);

// The number in "12 packets dropped by kernel", which tcpdump writes when it ends; nullopt when the
// text has no such line.
std::optional<std::uint64_t> parse_capture_drops(std::string_view text);

// One flow of iperf3's numbered datagrams.
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

}  // namespace interneuron::netns::verify
