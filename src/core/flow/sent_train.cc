// SentTrain: what a path has sent of the train whose dispersion the peer reports.
#include <algorithm>

#include "core/flow/packet_log.h"

namespace interneuron::flow {
namespace {

// Probes of a train are this far apart at most; others were not sent as one train. A full packet
// takes so long at 0.23 Mbit/s.
constexpr Duration kProbeGap = std::chrono::milliseconds(50);

}  // namespace

std::optional<link::Train> SentTrain::told(const PacketLog& log, const wire::LinkReport& report) {
  if (report.train_packets == 0 || report.train_start == 0) return std::nullopt;
  if (number_ != report.train_start) {
    if (!log.keeps(report.train_start)) return std::nullopt;
    const PacketLog::Packet& first = log.at(report.train_start);
    if (!first.data_sized) return std::nullopt;
    *this = {};
    number_ = seen_ = report.train_start;
    at_ = last_at_ = first.at;
    from_ = log.data_of(first).train_bytes;
    last_waited_ = !first.app_limited;
    last_is_probe_ = !first.has_piece;
  }
  for (std::uint64_t n = report.largest; n > number_ && log.keeps(n); --n) {
    const PacketLog::Packet& last = log.at(n);
    if (!last.data_sized || last.fate != PacketLog::Fate::kArrived) continue;
    follow(log, n);
    link::Train train;
    train.id = number_;
    train.packets = std::min(report.train_packets, left_);
    train.left = left_;
    train.bytes = log.data_of(last).train_bytes - from_;
    train.measured = report.train_rate;
    if (last.at > at_) train.sent_at = rate_of(train.bytes, last.at - at_);
    train.pause = pause_;
    return train;
  }
  return std::nullopt;
}

// Follows the packets of the train up to `last` for times in which nothing was there to be sent.
// The probes of a train wait for their pace, whatever waits behind them.
void SentTrain::follow(const PacketLog& log, std::uint64_t last) {
  for (std::uint64_t n = std::max(seen_, log.oldest() - 1) + 1; n <= last; ++n) {
    const PacketLog::Packet& packet = log.at(n);
    if (!packet.data_sized) continue;
    const Duration gap = packet.at - last_at_;
    const bool one_train = last_is_probe_ && !packet.has_piece && gap <= kProbeGap;
    if (!last_waited_ && !one_train) pause_ = std::max<Duration>(pause_, gap);
    ++left_;
    last_at_ = packet.at;
    last_waited_ = !packet.app_limited;
    last_is_probe_ = !packet.has_piece;
  }
  seen_ = std::max(seen_, last);
}

}  // namespace interneuron::flow
