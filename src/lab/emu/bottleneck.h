// The bottleneck of one direction: when a packet that waits for it has left it. Three kinds of
// rate, all of IP bytes:
//
//   constant       to the exact fraction of a nanosecond
//   stepped        a rate from each of a list of instants on, optionally repeating; 0 = stands
//   opportunities  Mahimahi's trace format: one integer per line, in ms since the start, each an
//                  opportunity to send 1500 bytes; an instant may repeat; the last line is also the
//                  length of the trace, which repeats from there. Packets share an opportunity, one
//                  larger than what is left of it takes the next as well; what nobody waits for is
//                  wasted.
//
// Pure values; thread-compatible. Times are since the start of the link.
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
  Duration at{};  // since the start of the link or of the period
  DataRate rate{};
};

// The first step is at 0 and instants rise strictly; before the last step of all ends, some rate is
// above 0. period 0: the last rate stays for ever; otherwise it is beyond the last step's instant.
struct SteppedRate {
  std::vector<RateStep> steps;
  Duration period{};
};

// Instants in ms, not falling, at least one; the last is above 0.
struct Opportunities {
  std::vector<std::int64_t> at_ms;
};

// Shared: a trace has thousands of entries and both copies of a profile read the same.
using RateTrace =
    std::variant<std::shared_ptr<const SteppedRate>, std::shared_ptr<const Opportunities>>;

// Mahimahi's format. The error is "line 7: …", without the file's name. Empty lines and lines that
// begin with # are skipped.
std::variant<Opportunities, std::string> parse_opportunities(std::string_view text);

// Long-run means, for the size of a queue and for displays.
DataRate mean_rate(const SteppedRate& rate);
DataRate mean_rate(const Opportunities& trace);

class Bottleneck {
 public:
  explicit Bottleneck(DataRate rate);
  // The trace begins at `origin`; before it nothing is sent.
  explicit Bottleneck(const RateTrace& trace, Duration origin = {});

  // When a packet that is there at `at` has left, after all that were sent before. Does not yet
  // send it; Duration::max(): never.
  Duration departure(Duration at, std::size_t ip_bytes);
  // Sends the packet that departure() was asked about last.
  void send() { sent_ = asked_; }
  // Nothing leaves before `t` but what was sent.
  void busy_until(Duration t);
  // The mean over [at, at + span).
  DataRate mean(Duration at, Duration span) const;

 private:
  struct State {
    Duration busy_until{};
    // constant, stepped: the part of a nanosecond beyond busy_until, in 1/rate ns.
    std::int64_t remainder = 0;
    // opportunities: of the present one, what is left.
    std::uint64_t opportunity = 0;  // counted over all laps
    std::size_t left = 0;
  };

  void send_constant(State& state, std::int64_t rate, std::size_t ip_bytes) const;
  bool send_stepped(State& state, const SteppedRate& stepped, std::size_t ip_bytes) const;
  void send_opportunities(State& state, const Opportunities& trace, std::size_t ip_bytes) const;

  DataRate rate_{};
  RateTrace trace_;
  bool traced_ = false;
  Duration origin_{};
  State sent_;  // in time since the origin
  State asked_;
};

}  // namespace interneuron::emu
