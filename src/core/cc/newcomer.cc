#include "core/cc/newcomer.h"

#include <chrono>

namespace interneuron::cc {
namespace {

// A path is new for so long after the first message that it was asked for. No measurement behind
// this value: it is what a crowd takes to find its shares.
constexpr Duration kNew = std::chrono::seconds(2);
// The most messages that are small at the beginning. A camera at 10 Hz sees within three of them
// what the first one did to the queue.
constexpr int kMostSmall = 3;
// A peer tells of what came within a few milliseconds (src/core/peers/feedback_due.h); what is told
// of so long after a round trip has waited in a queue. What is not told of after the second time
// never came. No measurement behind either value.
constexpr Duration kToldLate = std::chrono::milliseconds(20);
constexpr Duration kNeverTold = std::chrono::milliseconds(500);

}  // namespace

void Newcomer::train_waited(Duration beyond) {
  a_train_waited_ = a_train_waited_ || beyond > kToldLate;
}

void Newcomer::asked(TimePoint now, bool met, double part, Duration least_round_trip) {
  if (began_at_) {
    if (small_ > 0) --small_;
    return;
  }
  began_at_ = now;
  const bool may_be_late = !is_told_ && sent_at_ && least_round_trip > Duration::zero();
  const Duration since = may_be_late ? now - *sent_at_ : Duration::zero();
  const bool is_late = since > least_round_trip + kToldLate && since < kNeverTold;
  begins_low_ = met || a_train_waited_ || (may_be_late && is_late);
  if (begins_low_) small_ = static_cast<std::uint8_t>(1 + static_cast<int>(part * kMostSmall));
}

bool Newcomer::is_new(TimePoint now) const {
  return !is_over_ && (!began_at_ || now - *began_at_ <= kNew);
}

}  // namespace interneuron::cc
