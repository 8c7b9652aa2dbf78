// A stream of plain messages from a vehicle to a roadside unit over any links, and what became of
// each.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/wire/packet.h"
#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim {

using namespace std::chrono_literals;

class Stream {
 public:
  struct Options {
    std::string policy = "best_link";
    std::vector<std::size_t> variants{128 * 1024};
    Duration deadline = 100ms;
    Duration period = 100ms;
    // Of the NICs of both hosts; 1500 where the list is shorter.
    std::vector<std::size_t> nic_mtus{};
    std::uint64_t seed = 1;
  };

  Stream(const std::vector<emu::LinkProfile>& profiles, Options options)
      : world(options.seed), options_(std::move(options)) {
    EndpointOptions o;
    o.policies = builtin_policies();
    o.session = SessionId{1};
    vehicle = world.add_host(o);
    o.session = SessionId{2};
    o.accept_peers = true;
    road = world.add_host(o);
    for (std::size_t i = 0; i < profiles.size(); ++i) {
      const LinkId link{static_cast<std::uint8_t>(i)};
      const std::size_t mtu = i < options_.nic_mtus.size() ? options_.nic_mtus[i] : 1500;
      for (const HostId host : {vehicle, road}) {
        world.add_nic(host, link, {profiles[i].name, mtu, {}});
      }
      world.add_link(vehicle, road, link, profiles[i].name,
                     emu::Link(profiles[i], emu::link_seed(options_.seed, i)));
    }
    world.on_event([this](HostId host, Event&& event) {
      if (const auto* message = std::get_if<Message>(&event); message != nullptr && host == road) {
        got.at(index_of(message->bytes)) = message->variant;
      } else if (const auto* change = std::get_if<PathChanged>(&event);
                 change != nullptr && host == vehicle) {
        changes.emplace_back(world.now(), *change);
      }
    });
    peer = world.connect(vehicle, road);
  }

  // `count` messages from `from` on.
  void send(Duration from, std::size_t count) {
    got.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      world.at(from + static_cast<std::int64_t>(i) * options_.period, [this, i] { send_one(i); });
    }
    end_ = from + static_cast<std::int64_t>(count) * options_.period + options_.deadline;
  }
  // Runs to the end of the last message.
  void run() { world.run_until(end_ + 200ms); }

  // Of the messages [first, last).
  std::size_t missed(std::size_t first = 0, std::size_t last = SIZE_MAX) const {
    return count(first, last, [](const auto& variant) { return !variant; });
  }
  std::size_t degraded(std::size_t first = 0, std::size_t last = SIZE_MAX) const {
    return count(first, last, [](const auto& variant) { return variant && *variant > 0; });
  }

  World world;
  HostId vehicle = 0;
  HostId road = 0;
  PeerId peer{};
  // The variant of each message that was delivered in time.
  std::vector<std::optional<std::uint8_t>> got;
  // What the vehicle was told.
  std::vector<std::pair<Duration, PathChanged>> changes;

 private:
  static std::size_t index_of(const Bytes& bytes) {
    return std::to_integer<std::size_t>(bytes[0]) | std::to_integer<std::size_t>(bytes[1]) << 8U;
  }
  void send_one(std::size_t index) {
    Variants variants;
    for (const std::size_t size : options_.variants) {
      variants.emplace_back(std::max<std::size_t>(size, 2));
      variants.back()[0] = static_cast<std::byte>(index);
      variants.back()[1] = static_cast<std::byte>(index >> 8U);
    }
    SendOptions how;
    how.policy = options_.policy;
    how.deadline = options_.deadline;
    world.endpoint(vehicle).send(world.local_time(vehicle), peer, std::move(variants), how);
    world.flush(vehicle);
  }
  std::size_t count(std::size_t first, std::size_t last,
                    const std::function<bool(const std::optional<std::uint8_t>&)>& what) const {
    const auto end = static_cast<std::ptrdiff_t>(std::min(last, got.size()));
    return static_cast<std::size_t>(
        std::count_if(got.begin() + static_cast<std::ptrdiff_t>(first), got.begin() + end, what));
  }

  Options options_;
  Duration end_{};
};

}  // namespace interneuron::sim
