#include "core/link/delivery_rate.h"

#include <algorithm>

namespace interneuron::link {

DeliveryStamp DeliveryRate::sent(TimePoint now, std::uint32_t bytes, bool idle, bool more_waits) {
  if (idle) first_sent_at_ = delivered_at_ = now;
  return {now, first_sent_at_, delivered_at_, delivered_, bytes, !more_waits};
}

void DeliveryRate::acknowledged(TimePoint now, const DeliveryStamp& stamp) {
  delivered_ += stamp.bytes;
  delivered_at_ = now;
  if (!newest_ || stamp.delivered > newest_->delivered ||
      (stamp.delivered == newest_->delivered && stamp.sent_at > newest_->sent_at)) {
    newest_ = stamp;
    first_sent_at_ = stamp.sent_at;
  }
}

std::optional<DeliveryRate::Sample> DeliveryRate::sample(Duration min_rtt) {
  if (!newest_) return std::nullopt;
  const DeliveryStamp stamp = *newest_;
  newest_.reset();
  const Duration interval =
      std::max(stamp.sent_at - stamp.first_sent_at, delivered_at_ - stamp.delivered_at);
  if (interval < min_rtt || interval <= Duration::zero()) return std::nullopt;
  const auto bytes = static_cast<std::size_t>(delivered_ - stamp.delivered);
  return Sample{rate_of(bytes, interval), stamp.app_limited};
}

}  // namespace interneuron::link
