#include "emu/link_model.h"

#include <algorithm>
#include <utility>

namespace interneuron::emu {

LinkModel::LinkModel(DirectionParams params, std::shared_ptr<DelayProcess> process,
                     std::uint64_t loss_seed)
    : params_(params), process_(std::move(process)), rng_(loss_seed) {}

bool LinkModel::enqueue(Duration now, std::size_t ip_bytes, std::uint64_t tag) {
  ++stats_.packets_in;
  stats_.bytes_in += ip_bytes;

  const double backlog = backlog_bytes(now);
  const bool full = backlog > 0 && backlog + static_cast<double>(ip_bytes) >
                                       static_cast<double>(params_.queue_bytes);
  if (full || params_.rate.bits_per_second <= 0) {
    ++stats_.queue_drops;
    return false;
  }
  transmit(now, ip_bytes);

  const DelayProcess::Sample sample = process_->at(busy_until_);
  // Drawn for every packet that was sent, whatever the probability, so that two profiles with
  // different loss see the same sequence of draws.
  if (uniform_(rng_) < sample.loss) {
    ++stats_.lost;
    return false;
  }
  last_due_ = std::max(last_due_, busy_until_ + sample.rtt / 2);
  inside_.push_back({tag, ip_bytes, last_due_});
  return true;
}

std::optional<Duration> LinkModel::next_delivery() const {
  if (inside_.empty()) return std::nullopt;
  return inside_.front().due;
}

std::optional<LinkModel::Packet> LinkModel::dequeue(Duration now) {
  if (inside_.empty() || inside_.front().due > now) return std::nullopt;
  const Packet packet = inside_.front();
  inside_.pop_front();
  ++stats_.delivered;
  stats_.bytes_delivered += packet.ip_bytes;
  return packet;
}

double LinkModel::backlog_bytes(Duration now) const {
  if (busy_until_ <= now) return 0;
  return static_cast<double>((busy_until_ - now).count()) *
         static_cast<double>(params_.rate.bits_per_second) / 8e9;
}

// Moves busy_until_ on by the time that the packet takes, to the exact fraction of a nanosecond.
void LinkModel::transmit(Duration now, std::size_t ip_bytes) {
  if (busy_until_ < now) {
    busy_until_ = now;
    busy_remainder_ = 0;
  }
  const std::int64_t rate = params_.rate.bits_per_second;
  // An IP packet has at most 65535 bytes = 5.3e14 bit ns, far from overflow.
  const std::int64_t bit_ns =
      static_cast<std::int64_t>(ip_bytes) * 8 * std::int64_t{1'000'000'000} + busy_remainder_;
  busy_until_ += Duration{bit_ns / rate};
  busy_remainder_ = bit_ns % rate;
}

}  // namespace interneuron::emu
