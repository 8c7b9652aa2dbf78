// Fleets of other transports, and cross traffic.
#include <algorithm>
#include <cassert>

#include "lab/foreign/congestion.h"
#include "lab/foreign/transports.h"
#include "lab/load/fleet.h"

namespace interneuron::load {
namespace {

using foreign::MessageSink;
using foreign::MessageSource;
using foreign::TcpSource;

constexpr LinkId kLink{0};
// Only a vehicle with two modems has it.
constexpr LinkId kSecondLink{1};

std::unique_ptr<foreign::CongestionControl> cubic() { return std::make_unique<foreign::Cubic>(); }

std::vector<LinkId> links_of(Peer peer) {
  if (peer == Peer::kMptcpLike) return {kLink, kSecondLink};
  return {kLink};
}

std::unique_ptr<MessageSink> sink_of(Peer peer) {
  if (peer == Peer::kUdp) return std::make_unique<foreign::UdpSink>();
  return std::make_unique<foreign::TcpSink>();
}

std::unique_ptr<MessageSource> source_of(Peer peer, foreign::ConnectionId id, sim::HostId road) {
  std::vector<TcpSource::Path> paths;
  for (const LinkId link : links_of(peer)) {
    paths.push_back({link, sim::World::address_of(road, link)});
  }
  if (peer == Peer::kUdp) {
    return std::make_unique<foreign::UdpSource>(id, kLink, paths.front().to);
  }
  if (peer != Peer::kBbrLike) return std::make_unique<TcpSource>(id, paths, cubic);
  return std::make_unique<TcpSource>(id, paths,
                                     [] { return std::make_unique<foreign::BbrLike>(); });
}

class Foreigners final : public Fleet {
 public:
  Foreigners(const Scenario& scenario, sim::World& world, sim::CellId cell, Meter& meter)
      : s_(scenario), world_(world), meter_(meter) {
    auto sink = sink_of(scenario.peer);
    sink_ = sink.get();
    const sim::HostId road = world.add_foreign(std::move(sink));
    for (std::size_t v = 0; v < scenario.vehicles; ++v) {
      auto source = source_of(scenario.peer, static_cast<foreign::ConnectionId>(v), road);
      sources_.push_back(source.get());
      hosts_.push_back(world.add_foreign(std::move(source)));
      for (const LinkId link : links_of(scenario.peer)) {
        join(scenario, world, hosts_[v], road, link, cell);
      }
    }
  }

  void send(std::size_t vehicle, std::uint32_t number) override {
    const Duration now = world_.now();
    sources_[vehicle]->send(now, {number, s_.message_bytes, now + s_.deadline});
    world_.flush(hosts_[vehicle]);
  }

  void collect() override {
    while (const auto arrival = sink_->poll_arrival()) {
      meter_.arrived(arrival->connection, arrival->number, 0, arrival->at);
    }
  }

 private:
  const Scenario& s_;
  sim::World& world_;
  Meter& meter_;
  // The world owns them.
  MessageSink* sink_ = nullptr;
  std::vector<MessageSource*> sources_;
  std::vector<sim::HostId> hosts_;
};

}  // namespace

std::unique_ptr<Fleet> make_fleet(const Scenario& scenario, sim::World& world, sim::CellId cell,
                                  Meter& meter) {
  assert(std::ranges::find(modelled_peers(), scenario.peer) != modelled_peers().end());
  const bool is_ours = scenario.peer == Peer::kOurs || scenario.peer == Peer::kOursVariants;
  if (is_ours) return ours(scenario, world, cell, meter);
  return std::make_unique<Foreigners>(scenario, world, cell, meter);
}

CrossTraffic::CrossTraffic(const Scenario& scenario, sim::World& world, sim::CellId cell)
    : world_(world) {
  auto sink = std::make_unique<foreign::TcpSink>();
  sink_ = sink.get();
  const sim::HostId road = world.add_foreign(std::move(sink));
  for (std::size_t i = 0; i < scenario.cross_flows; ++i) {
    const Peer peer = scenario.is_cross_bbr ? Peer::kBbrLike : Peer::kCubic;
    auto source = source_of(peer, static_cast<foreign::ConnectionId>(i), road);
    sources_.push_back(source.get());
    hosts_.push_back(world.add_foreign(std::move(source)));
    join(scenario, world, hosts_[i], road, kLink, cell);
  }
}

void CrossTraffic::start() {
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    sources_[i]->send(world_.now(), {0, foreign::kUnlimitedBytes});
    world_.flush(hosts_[i]);
  }
}

std::uint64_t CrossTraffic::readable_bytes() const {
  std::uint64_t out = 0;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    out += sink_->readable_bytes(static_cast<foreign::ConnectionId>(i));
  }
  return out;
}

}  // namespace interneuron::load
