#include "core/peers/settlements.h"

#include <algorithm>

#include "core/flow/receipts.h"

namespace interneuron {

void Settlements::learn(const wire::Feedback& feedback, std::optional<TimePoint> left,
                        std::span<const Path> paths) {
  if (left) {
    for (const wire::LinkReport& report : feedback.reports) {
      const bool known = std::ranges::find(paths, report.link, &Path::id) != paths.end();
      if (known) told_[report.link] = *left;
    }
    if (feedback.reports.size() >= paths.size()) told_all_ = *left;
  }
  if (!open_) return;
  for (const auto& [message, ago_us, dropped] : feedback.complete) {
    const Duration ago = std::chrono::microseconds(ago_us);
    settled_.push_back({dropped ? Settled::Kind::kDroppedThere : Settled::Kind::kComplete, message,
                        PeerTime{Duration{wrapping_sub(feedback.u, ago.count())}}});
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

TimePoint Settlements::told_until(std::span<const Path> paths) const {
  if (paths.empty()) return told_all_;
  TimePoint oldest = TimePoint::max();
  for (const Path& path : paths) {
    const auto it = told_.find(path.id());
    if (it == told_.end()) return told_all_;
    oldest = std::min(oldest, it->second);
  }
  return std::max(told_all_, oldest - flow::Receipts::kLeftOver);
}

void Settlements::reset() {
  settled_.clear();
  told_all_ = TimePoint::min();
  told_.clear();
}

}  // namespace interneuron
