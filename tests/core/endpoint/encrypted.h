// A vehicle and a roadside unit that encrypt, joined by a Pipe, with what they were told.
#pragma once

#include <vector>

#include "lab/sim/trust.h"
#include "pair.h"

namespace interneuron {

inline constexpr int kVehicleKey = 1;
inline constexpr int kRoadKey = 2;

struct Encrypted {
  Pipe pipe;
  std::size_t vehicle = 0;
  std::size_t road = 0;
  PeerId peer{};
  std::vector<Delivered> delivered;
  std::vector<RoundDone> done;
  std::vector<std::size_t> ready;
  int restarted = 0;
  int lost = 0;
  std::vector<Pipe::Captured> captured;

  explicit Encrypted(std::initializer_list<int> trusted = {kVehicleKey}) {
    vehicle = pipe.add_host(vehicle_options());
    road = pipe.add_host(road_options(trusted), 1h);
    pipe.capture = &captured;
    pipe.on_event = [this](std::size_t host, Event& e) {
      if (auto* d = std::get_if<Delivered>(&e)) {
        delivered.push_back(*d);
        if (host == road) pipe.plan(5ms, [this, r = d->round] { pipe.submit(road, r, 100); });
      } else if (auto* r = std::get_if<RoundDone>(&e)) {
        done.push_back(*r);
      } else if (std::holds_alternative<PeerReady>(e)) {
        ready.push_back(host);
      } else if (std::holds_alternative<PeerRestarted>(e)) {
        ++restarted;
      } else if (std::holds_alternative<PeerLost>(e)) {
        ++lost;
      }
    };
    peer = pipe.connect(vehicle, road);
    pipe.run(1s);
  }
  static EndpointOptions vehicle_options(int life = 0) {
    EndpointOptions o =
        options_of(11 + static_cast<std::uint32_t>(life), {pipeline_of(kOffload)}, false);
    o.security = sim::security_of(kVehicleKey, {kRoadKey}, life);
    return o;
  }
  static EndpointOptions road_options(std::initializer_list<int> trusted, int life = 0) {
    EndpointOptions o = options_of(22 + static_cast<std::uint32_t>(life));
    o.security = sim::security_of(kRoadKey, trusted, life);
    return o;
  }
  void rounds(int count) {
    for (int i = 0; i < count; ++i) {
      pipe.round(vehicle, PipelineId{0}, {Bytes(20'000), Bytes(5'000)});
      pipe.run(100ms);
    }
  }
  int remote() const {
    return static_cast<int>(std::ranges::count(done, Outcome::kRemote, &RoundDone::outcome));
  }
};

}  // namespace interneuron
