// How large datagrams may be on one path: packetization layer path MTU discovery for datagram
// transports (RFC 8899), from what the peer acknowledges alone. No ICMP message is believed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "interneuron/sizes.h"
#include "interneuron/time.h"

namespace interneuron::link {

// Begins with kBase, which every path that IPv6 allows carries, and searches upwards with padded
// probes: the size of the NIC first, which is nearly always right, and then the middle between what
// has arrived and what has not. A probe that is lost takes no message with it and says nothing of
// the path's loss. A size counts as too large after kMaxProbes of it were lost while something that
// left later has arrived: what an outage takes says nothing of sizes. The search ends at kStep, and
// begins again after kRaise. Where large packets vanish and small ones between them arrive (a black
// hole: the path has changed), it falls back to kBase at once and searches again.
//
// Sizes are UDP payloads in bytes. Owned by the Path (src/core/peers), which sends the probes and
// tells of the peer's reports. A peer that lies about what has arrived harms what is sent to
// itself: its messages are cut too large and vanish, or too small. Pure; thread-compatible;
// constant memory.
class PathMtu {
 public:
  // BASE_PLPMTU of RFC 8899, section 5.1.2.
  static constexpr std::size_t kBase = kLeastDatagramBytes;
  // MAX_PROBES and PROBE_TIMER (section 5.1.2 and 5.1.1).
  static constexpr int kMaxProbes = 3;
  static constexpr Duration kProbeTimer = std::chrono::seconds(1);
  // PMTU_RAISE_TIMER (section 5.1.1).
  static constexpr Duration kRaise = std::chrono::seconds(600);
  // The first probe leaves with the first heartbeat, whose answer comes at once. That of the probe
  // comes as much later as feedback may be delayed (src/core/peers/feedback_due.h), with jitter.
  static constexpr Duration kAnswer = std::chrono::milliseconds(20);
  // The search ends where the next size is closer than this: 1 % of a packet. No measurement behind
  // this value.
  static constexpr std::size_t kStep = 16;
  // So many large packets lost in a row, over this time, are a black hole if smaller ones that left
  // between them have arrived. No measurement behind these values: a full queue does not take all
  // large packets for so long, since it empties at the link's rate, and an outage takes the small
  // ones as well.
  static constexpr std::uint32_t kBlackHolePackets = 6;
  static constexpr Duration kBlackHoleTime = std::chrono::milliseconds(50);

  // `most`: what the NIC carries.
  explicit PathMtu(std::size_t most) : most_(most), tried_(most + 1) {}

  // What messages may be cut to.
  std::size_t datagram() const { return most_ < kBase ? most_ : datagram_; }

  // --- probes
  // The peer answers on this path. Before that only one probe leaves, and its loss says nothing.
  void set_ready(TimePoint now, bool ready) {
    if (ready && !ready_) ready_at_ = now;
    ready_ = ready;
  }
  // The answer to the very first probe is about to come: what wants to send full packets waits.
  bool answer_is_near(TimePoint now) const {
    return number_ && blind_ && ready_ && now < ready_at_ + kAnswer;
  }
  bool probe_due() const;
  std::size_t probe_size() const;
  void probe_sent(TimePoint now, std::uint64_t number);
  // The packet number of the probe that waits for its report.
  std::optional<std::uint64_t> waits_for() const { return number_; }
  // Call it at next_timeout(), when another probe may become due.
  void handle_timeout(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

  // --- what became of packets
  // A report has come of the probe's packet number or a later one; `arrived`: it has the probe.
  void probe_told(bool arrived);
  // What became of messages' packets that are larger than kBase, and of smaller packets, since the
  // last call: when the newest of each that arrived had left, and how many large ones were lost.
  struct Told {
    std::optional<TimePoint> large_arrived;
    std::optional<TimePoint> small_arrived;
    std::uint32_t large_lost = 0;
    TimePoint first_lost{};
    TimePoint last_lost{};
    void arrived(TimePoint sent_at, bool large);
    void lost(TimePoint sent_at);
  };
  void packets_told(const Told& told);

 private:
  bool is_done() const { return tried_ <= datagram_ + kStep; }
  void search();

  std::size_t most_ = 0;
  std::size_t datagram_ = kBase;
  // The smallest size that was found too large; one above `most_` while none was.
  std::size_t tried_ = 0;
  // Probes of the present size that were lost.
  int lost_ = 0;
  bool ready_ = false;
  TimePoint ready_at_{};
  // The newest probe: its number while it waits for its report, its size, when it left, whether
  // that was before the peer answered, and whether something that left later has arrived.
  std::optional<std::uint64_t> number_;
  std::size_t size_ = 0;
  std::optional<TimePoint> sent_at_;
  bool blind_ = false;
  bool passed_ = false;
  // Large packets lost in a row, and the first small one known to have left since the first of
  // them and to have arrived.
  Told run_;
};

}  // namespace interneuron::link
