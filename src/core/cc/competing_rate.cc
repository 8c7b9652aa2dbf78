#include "core/cc/competing_rate.h"

#include <algorithm>
#include <cmath>

#include "interneuron/sizes.h"

namespace interneuron::cc {
namespace {

// RFC 9438, section 4.1: the growth in packets per second cubed, and what a loss leaves.
constexpr double kGrowth = 0.4;
constexpr double kLeftByLoss = 0.7;
// RFC 7661, section 4.3: a window of which half was used is a valid one.
constexpr double kValid = 2;
// Who takes less than half of the pipe is not the one to give way: that is an equal share beside
// one flow, and of n flows each has (n + 1) / 2n of an equal share then, which is more than half of
// it. But where more is lost than BBR version 3 bears in a round trip
// (draft-cardwell-iccrg-bbr-congestion-control), there are many of us.
constexpr double kHalfOfPipe = 0.5;
constexpr double kBearable = 0.02;
// What is wanted and what repairs of it take.
constexpr double kWithRepairsToo = 1.2;
// Memory of what is lost, in seconds. A CUBIC flow fills a queue of 100 ms up every few seconds.
constexpr double kLossMemory = 3;
// No round trip over a radio is shorter.
constexpr Duration kLeastRoundTrip = std::chrono::milliseconds(10);

// Bits per second of one packet per round trip.
double packet_rate(Duration round_trip) {
  return 8 * static_cast<double>(kMaxPacketBytes) /
         to_seconds(std::max(round_trip, kLeastRoundTrip));
}

}  // namespace

void CompetingRate::begin(TimePoint now, DataRate rate) {
  rate_ = before_ = rate;
  fell_at_ = lost_at_ = now;
  lost_ = 0;
}

double CompetingRate::lost_lately(TimePoint now) const {
  return lost_ * std::exp(-to_seconds(now - lost_at_) / kLossMemory);
}

// RFC 9438, section 4.7: who falls before it is back where it was leaves what it had to others.
void CompetingRate::lost(TimePoint now, std::uint32_t packets, Duration round_trip) {
  lost_ = lost_lately(now) + packets / kLossMemory;
  lost_at_ = now;
  if (now - fell_at_ < round_trip) return;
  before_ = rate_ < before_ ? rate_.scaled((1 + kLeftByLoss) / 2) : rate_;
  rate_ = rate_.scaled(kLeftByLoss);
  fell_at_ = now;
}

DataRate CompetingRate::at(TimePoint now, Duration round_trip, DataRate wanted, DataRate capacity) {
  const double packet = packet_rate(round_trip);
  const double before = static_cast<double>(before_.bits_per_second) / packet;
  const double back_after = std::cbrt(before * (1 - kLeftByLoss) / kGrowth);
  const double since = to_seconds(now - fell_at_) - back_after;
  const double window = before + kGrowth * since * since * since;
  const DataRate grown{static_cast<std::int64_t>(window * packet)};
  rate_ = std::min(std::max(rate_, grown), wanted.scaled(kValid));
  const DataRate least = std::min(wanted.scaled(kWithRepairsToo), capacity.scaled(kHalfOfPipe));
  const double lost = 8 * lost_lately(now) * static_cast<double>(kMaxPacketBytes);
  const bool bears = lost < kBearable * static_cast<double>(least.bits_per_second);
  if (bears) rate_ = std::max(rate_, least);
  return rate_;
}

}  // namespace interneuron::cc
