// The bottleneck of one direction of a link: says when a packet has left it, after all packets
// before. It keeps no packets; LinkModel has the queue. Three kinds of rate, all of IP bytes:
//
//   constant       exact to a fraction of a nanosecond
//   stepped        from each of a list of instants on a rate, 0 for none; the list may repeat
//   opportunities  Mahimahi's trace format: one integer per line, in ms since the start, each an
//                  opportunity to send 1500 bytes; an instant may repeat; the last line is also the
//                  length of the trace, which repeats from there. Packets share an opportunity; one
//                  larger than what is left of it takes the next as well. An opportunity for which
//                  no packet waits is lost.
//
// A carrier often sets a token bucket beside it: TokenBucket says which packets conform to one.
//
// Pure; thread-compatible. Times are since the start of the link. Errors: parse_opportunities()
// returns one line of text; a rate that stays 0 gives a departure of Duration::max().
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "interneuron/units.h"

namespace interneuron::emu {

// Mahimahi's unit (its MTU-sized packet).
inline constexpr std::size_t kOpportunityBytes = 1500;

struct RateStep {
  // Since the start of the link or of the period.
  Duration at{};
  DataRate rate{};
};

// The first step is at 0, instants rise strictly, and some rate is above 0. With period 0 the last
// rate stays for ever; otherwise the steps repeat after `period`, which is longer than the last
// instant.
struct SteppedRate {
  std::vector<RateStep> steps;
  Duration period{};
};

// Instants in ms, never falling. There is at least one, and the last is above 0.
struct Opportunities {
  std::vector<std::int64_t> at_ms;
};

// Shared by all copies of a profile, as a trace has thousands of entries.
using RateTrace =
    std::variant<std::shared_ptr<const SteppedRate>, std::shared_ptr<const Opportunities>>;

// Reads Mahimahi's format. The error is "line 7: …", without the file's name. Empty lines and lines
// that begin with # are skipped.
std::variant<Opportunities, std::string> parse_opportunities(std::string_view text);

// The mean rate in the long run, for the size of a queue and for displays.
DataRate mean_rate(const SteppedRate& rate);
DataRate mean_rate(const Opportunities& trace);

// Usage: departure() for a packet, then send() if it is really sent.
class Bottleneck {
 public:
  explicit Bottleneck(DataRate rate);
  // The trace begins at `origin`; before it nothing is sent.
  explicit Bottleneck(const RateTrace& trace, Duration origin = {});

  // When a packet that arrives at `at` would have left, after all packets sent before; or
  // Duration::max() when it would never. The packet does not count as sent yet.
  Duration departure(Duration at, std::size_t ip_bytes);
  // Sends the packet of the last departure().
  void send() { sent_ = asked_; }
  // Blocks further departures until `t`.
  void busy_until(Duration t);
  // The same where it would be free earlier.
  void hold_until(Duration t) {
    if (sent_.busy_until < t - origin_) busy_until(t);
  }
  // The mean rate over [at, at + span).
  DataRate mean(Duration at, Duration span) const;

 private:
  // After a packet.
  struct State {
    Duration busy_until{};
    // For constant and stepped rates: the part of a nanosecond beyond busy_until, in 1/rate ns.
    std::int64_t remainder = 0;
    // For opportunities: the number of the present one, counted over all repetitions of the trace,
    // and the bytes left of it.
    std::uint64_t opportunity = 0;
    std::size_t left = 0;
  };

  void send_constant(State& state, std::int64_t rate, std::size_t ip_bytes) const;
  bool send_stepped(State& state, const SteppedRate& stepped, std::size_t ip_bytes) const;
  void send_opportunities(State& state, const Opportunities& trace, std::size_t ip_bytes) const;

  DataRate rate_{};
  RateTrace trace_;
  bool traced_ = false;
  Duration origin_{};
  // After the packet sent last, and after the one of the last departure(). Times are since origin_.
  State sent_;
  State asked_;
};

// A bucket of `bytes` that fills at `rate`, in IP bytes; with rate 0 there is none, and every
// packet conforms. A policer drops packets that do not conform, a shaper lets them wait until they
// do.
struct TokenBucketParams {
  DataRate rate{};
  std::size_t bytes = 0;
  friend bool operator==(const TokenBucketParams&, const TokenBucketParams&) = default;
};

// The state of such a bucket, as the generic cell rate algorithm of ATM keeps it: by the instant at
// which the bucket will be full. It is full at first. Usage: conforms(), then take() if the packet
// is sent.
class TokenBucket {
 public:
  explicit TokenBucket(const TokenBucketParams& params);
  // The same, empty at `t`.
  TokenBucket(const TokenBucketParams& params, Duration t);

  // The first instant from `at` on at which the bucket holds the bytes of the packet;
  // Duration::max() when it never does, because it is smaller than the packet.
  Duration conforms(Duration at, std::size_t ip_bytes) const;
  // Takes them at `at`, which is not before conforms().
  void take(Duration at, std::size_t ip_bytes);

 private:
  DataRate rate_;
  // How long the empty bucket takes to fill.
  Duration depth_{};
  Duration full_at_{};
};

}  // namespace interneuron::emu
