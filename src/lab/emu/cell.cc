#include "lab/emu/cell.h"

#include <algorithm>

namespace interneuron::emu {

namespace {

Bottleneck bottleneck_of(const CellParams& params) {
  return params.trace ? Bottleneck(*params.trace) : Bottleneck(params.rate);
}

bool has_opportunities(const CellParams& params) {
  return params.trace &&
         std::holds_alternative<std::shared_ptr<const Opportunities>>(*params.trace);
}

}  // namespace

Cell::Cell(const CellParams& params)
    : params_(params),
      bottleneck_(bottleneck_of(params)),
      codel_(params.codel.value_or(CoDelParams{})),
      judged_at_departure_(has_opportunities(params)) {}

template <class Change>
void Cell::count(std::uint32_t flow, const Change& change) {
  if (flows_.size() <= flow) flows_.resize(std::size_t{flow} + 1);
  change(stats_);
  change(flows_[flow]);
}

bool Cell::enqueue(Duration now, const Packet& packet) {
  advance(now);
  const std::size_t bytes = packet.ip_bytes;
  count(packet.flow, [&](CellStats& stats) {
    ++stats.packets_in;
    stats.bytes_in += bytes;
  });
  if (params_.mtu > 0 && bytes > params_.mtu) {
    count(packet.flow, [](CellStats& stats) { ++stats.too_big; });
    return false;
  }
  const bool idle = queue_.empty();
  if (!idle && waiting_bytes_ + bytes > params_.queue_bytes) {
    count(packet.flow, [](CellStats& stats) { ++stats.queue_drops; });
    return false;
  }
  queue_.push_back({packet, now});
  waiting_bytes_ += bytes;
  if (!idle) return true;
  queue_time_.add_empty(emptied_, now);
  serve_next(now);
  return true;
}

// Lets leave what has left by `now`.
void Cell::advance(Duration now) {
  while (!queue_.empty() && departure_ <= now) {
    const Duration at = departure_;
    const bool sent = !judged_at_departure_ || passes(queue_.front(), at);
    if (sent) bottleneck_.send();
    leave(at, !sent);
    serve_next(at);
  }
}

// The bottleneck is free at `at`: takes the first packet that CoDel lets pass.
void Cell::serve_next(Duration at) {
  while (!queue_.empty()) {
    if (judged_at_departure_ || passes(queue_.front(), at)) {
      departure_ = bottleneck_.departure(at, queue_.front().packet.ip_bytes);
      return;
    }
    leave(at, true);
  }
  codel_.emptied();
}

// Whether the packet is sent; marks it if it is to be marked.
bool Cell::passes(Waiting& waiting, Duration at) {
  const Duration sojourn = at - waiting.arrived;
  Packet& packet = waiting.packet;
  if (params_.mark_above && packet.ecn == Ecn::kEct1 && sojourn > *params_.mark_above) {
    packet.ecn = Ecn::kCe;
  }
  if (!params_.codel || !codel_.signals(at, sojourn, waiting_bytes_ - packet.ip_bytes)) return true;
  if (!is_ect(packet.ecn)) return false;
  packet.ecn = Ecn::kCe;
  return true;
}

// The packet at the head leaves the queue.
void Cell::leave(Duration at, bool dropped) {
  const Waiting gone = queue_.front();
  queue_.pop_front();
  waiting_bytes_ -= gone.packet.ip_bytes;
  queue_time_.add(gone.arrived, queue_.empty() ? at : queue_.front().arrived, at);
  emptied_ = at;
  out_.push_back({gone.packet, at, dropped});
  count(gone.packet.flow, [&](CellStats& stats) {
    if (dropped) {
      ++stats.codel_drops;
      return;
    }
    ++stats.delivered;
    stats.bytes_delivered += gone.packet.ip_bytes;
    if (gone.packet.ecn == Ecn::kCe) ++stats.marked;
  });
}

std::optional<Duration> Cell::next_departure() const {
  if (!out_.empty()) return out_.front().at;
  if (queue_.empty() || departure_ == Duration::max()) return std::nullopt;
  return departure_;
}

std::optional<Cell::Departed> Cell::dequeue(Duration now) {
  advance(now);
  if (out_.empty()) return std::nullopt;
  const Departed departed = out_.front();
  out_.pop_front();
  return departed;
}

void Cell::measure_from(Duration now) {
  queue_time_ = QueueTime(now);
  measured_from_ = now;
  bytes_before_ = stats_.bytes_delivered;
}

double Cell::utilisation(Duration now) const {
  const Duration span = now - measured_from_;
  if (span <= Duration{}) return 0;
  const double could = bottleneck_.mean(measured_from_, span).mbit() * 1e6 / 8 * to_seconds(span);
  if (could <= 0) return 0;
  return std::min(1.0, static_cast<double>(stats_.bytes_delivered - bytes_before_) / could);
}

const CellStats& Cell::stats(std::uint32_t flow) const {
  static const CellStats kNothing;
  return flow < flows_.size() ? flows_[flow] : kNothing;
}

}  // namespace interneuron::emu
