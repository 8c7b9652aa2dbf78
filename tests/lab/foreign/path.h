// Sources and one sink around a bottleneck, in virtual time: packets of the sources pass the cell
// and then a delay, what the sink sends comes back after the same delay. Faults by hand: `loses`
// says which packets vanish behind the cell.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "lab/emu/cell.h"
#include "lab/foreign/transports.h"

namespace interneuron::foreign {

using namespace std::chrono_literals;

inline Address address_of(std::size_t host) {
  Address a;
  a.raw[0] = static_cast<std::byte>(host);
  a.size = 1;
  return a;
}

class Path {
 public:
  Path(const emu::CellParams& cell, Duration one_way, std::unique_ptr<MessageSink> with_sink)
      : cell_(cell), one_way_(one_way), sink(std::move(with_sink)) {}

  MessageSource& add(std::unique_ptr<MessageSource> source) {
    sources_.push_back(std::move(source));
    return *sources_.back();
  }
  void at(Duration when, std::function<void()> action) { actions_.emplace(when, action); }
  Duration now() const { return now_; }
  const emu::Cell& cell() const { return cell_; }

  void run_until(Duration end) {
    while (true) {
      flush();
      const Duration next = next_instant();
      if (next > end) break;
      now_ = std::max(now_, next);
      step();
    }
    now_ = end;
  }

  // Messages that arrived, in their order.
  std::vector<Arrival> arrivals;
  std::function<bool(const sim::ForeignPacket&)> loses = [](const auto&) { return false; };
  std::uint64_t acks = 0;

 private:
  struct OnItsWay {
    std::size_t from = 0;
    sim::ForeignPacket packet;
  };

  void flush() {
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      while (auto packet = sources_[i]->poll_transmit(now_)) {
        inside_.push_back({i, std::move(*packet)});
        const OnItsWay& it = inside_.back();
        cell_.enqueue(now_, {inside_.size() - 1, static_cast<std::uint32_t>(i), it.packet.ip_bytes,
                             it.packet.ecn});
      }
    }
    while (auto packet = sink->poll_transmit(now_)) {
      ++acks;
      back_.emplace(now_ + one_way_, std::move(*packet));
    }
  }

  Duration next_instant() const {
    Duration next = cell_.next_departure().value_or(Duration::max());
    const auto earlier = [&next](const auto& queue) {
      if (!queue.empty()) next = std::min(next, queue.begin()->first);
    };
    earlier(actions_);
    earlier(there_);
    earlier(back_);
    next = std::min(next, sink->next_timeout(now_).value_or(Duration::max()));
    for (const auto& s : sources_) {
      next = std::min(next, s->next_timeout(now_).value_or(Duration::max()));
    }
    return next;
  }

  template <class Queue, class Handle>
  void take_due(Queue& queue, const Handle& handle) {
    while (!queue.empty() && queue.begin()->first <= now_) {
      auto value = std::move(queue.begin()->second);
      queue.erase(queue.begin());
      handle(value);
    }
  }

  void step() {
    while (const auto departed = cell_.dequeue(now_)) {
      OnItsWay& it = inside_[departed->packet.tag];
      it.packet.ecn = departed->packet.ecn;
      it.packet.peer = address_of(it.from);
      if (!departed->dropped && !loses(it.packet)) there_.emplace(now_ + one_way_, it.packet);
      it.packet.bytes = {};
    }
    take_due(there_, [this](auto& packet) { sink->handle_packet(now_, packet); });
    while (const auto arrival = sink->poll_arrival()) arrivals.push_back(*arrival);
    take_due(back_, [this](auto& packet) {
      const auto to = std::to_integer<std::size_t>(packet.peer.raw[0]);
      sources_[to]->handle_packet(now_, packet);
    });
    take_due(actions_, [](auto& action) { action(); });
    sink->handle_timeout(now_);
    for (const auto& s : sources_) s->handle_timeout(now_);
  }

  emu::Cell cell_;
  Duration one_way_;
  std::vector<std::unique_ptr<MessageSource>> sources_;
  std::vector<OnItsWay> inside_;
  std::multimap<Duration, sim::ForeignPacket> there_;
  std::multimap<Duration, sim::ForeignPacket> back_;
  std::multimap<Duration, std::function<void()>> actions_;
  Duration now_{};

 public:
  std::unique_ptr<MessageSink> sink;
};

inline emu::CellParams fifo(double mbit, Duration queue) {
  emu::CellParams params{.rate = DataRate::mbit(mbit)};
  params.queue_bytes = emu::queue_bytes_of(params.rate, queue);
  return params;
}

template <class Control>
std::unique_ptr<TcpSource> tcp(ConnectionId id, std::vector<LinkId> links = {LinkId{0}},
                               sim::Ecn ecn = sim::Ecn::kNotEct) {
  std::vector<TcpSource::Path> paths;
  for (const LinkId link : links) paths.push_back({link, address_of(99)});
  return std::make_unique<TcpSource>(
      id, paths, [] { return std::make_unique<Control>(); }, ecn);
}

// Readable payload over the capacity that is left for it in segments of TCP.
inline double share_of_link(const Path& path, ConnectionId id, Duration length) {
  const double payload = static_cast<double>(path.sink->readable_bytes(id)) * 8;
  const double capacity =
      static_cast<double>(path.cell().params().rate.bits_per_second) * kMss / 1500.0;
  return payload / capacity / to_seconds(length);
}

}  // namespace interneuron::foreign
