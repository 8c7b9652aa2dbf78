#include "core/peers/intake.h"

#include <algorithm>

namespace interneuron::peers {

void Settlements::learn(const wire::Feedback& feedback) {
  if (!open_) return;
  auto complete = feedback.complete;
  // They are few, and come nearly in order; std::stable_sort would ask the heap for memory.
  for (auto* it = complete.begin(); it != complete.end(); ++it) {
    auto* const place = std::ranges::upper_bound(
        complete.begin(), it, it->ago_us, std::ranges::greater{}, &wire::CompleteMessage::ago_us);
    std::rotate(place, it, it + 1);
  }
  for (const auto& [message, ago_us, dropped, kept] : complete) {
    const Duration ago = std::chrono::microseconds(ago_us);
    using Kind = Settled::Kind;
    settled_.push_back({dropped ? Kind::kDroppedThere
                        : kept  ? Kind::kKept
                                : Kind::kComplete,
                        message, PeerTime{Duration{wrapping_sub(feedback.u, ago.count())}}});
  }
  for (const MessageId message : feedback.refused) {
    settled_.push_back({Settled::Kind::kRefused, message});
  }
}

std::optional<Settled> Settlements::poll() {
  if (settled_.empty()) return std::nullopt;
  const Settled settled = settled_.front();
  settled_.pop_front();
  return settled;
}

}  // namespace interneuron::peers
