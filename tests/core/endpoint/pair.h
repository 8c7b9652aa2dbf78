// A vehicle and a roadside unit that answers, joined by a Pipe, with what they were told.
#pragma once

#include <vector>

#include "pipe.h"

namespace interneuron {

inline const std::vector<StageKind> kOffload = offload_stages();

// A vehicle (host 0) and a roadside (host 1) that answers after a computation.
struct Pair {
  Pipe pipe;
  std::size_t vehicle = 0;
  std::size_t road = 0;
  PeerId peer{};
  Duration compute = 20ms;
  bool answer = true;
  std::vector<Delivered> delivered;
  std::vector<Duration> delivered_at;
  std::vector<RoundDone> done;
  int ready = 0;
  int restarted = 0;
  int lost = 0;
  int refused = 0;

  explicit Pair(std::vector<PipelineConfig> pipelines = {pipeline_of(kOffload)},
                Duration road_clock = 0ns) {
    vehicle = pipe.add_host(options_of(1, std::move(pipelines), false));
    road = pipe.add_host(options_of(2), road_clock);
    pipe.on_event = [this](std::size_t host, Event& e) {
      if (auto* d = std::get_if<Delivered>(&e)) {
        delivered.push_back(*d);
        delivered_at.push_back(pipe.now());
        if (answer && host == road) {
          pipe.plan(compute, [this, ref = d->round] { pipe.submit(road, ref, 100); });
        }
      } else if (auto* r = std::get_if<RoundDone>(&e)) {
        done.push_back(*r);
      } else if (std::holds_alternative<PeerReady>(e)) {
        ++ready;
      } else if (std::holds_alternative<PeerRestarted>(e)) {
        ++restarted;
      } else if (std::holds_alternative<PeerLost>(e)) {
        ++lost;
      } else if (auto* planned = std::get_if<Planned>(&e)) {
        if (planned->plan.refused == kInsecure) ++refused;
      }
    };
    peer = pipe.connect(vehicle, road);
    pipe.run(1s);
  }
  void rounds(int count, Variants variants = {Bytes(20'000), Bytes(5'000)}) {
    for (int i = 0; i < count; ++i) {
      pipe.round(vehicle, PipelineId{0}, variants);
      pipe.run(100ms);
    }
  }
};

}  // namespace interneuron
