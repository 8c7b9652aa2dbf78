// Two endpoints that send each other plain messages, joined by a Pipe, with what they were told and
// when.
#pragma once

#include <map>
#include <vector>

#include "tests/core/endpoint/pipe.h"

namespace interneuron {

struct Door {
  struct Told {
    MessageFate what;
    Duration at{};
  };
  struct Came {
    Message what;
    Duration at{};
    // How many times the receiver had begun a new life before.
    int life = 0;
  };
  struct Sent {
    Duration at{};
    Duration deadline{};
  };

  Pipe pipe;
  std::size_t vehicle = 0;
  std::size_t road = 0;
  // The road as the vehicle knows it, and the vehicle as the road does.
  PeerId peer{};
  PeerId back{};
  std::map<SendId, Sent> sent;
  std::map<SendId, std::vector<Told>> fates;
  std::vector<Came> came;
  std::vector<CanSend> can_send;
  int lives = 0;
  // When the road forgot the vehicle, which is as much as a new life of its own.
  std::vector<Duration> forgotten;

  explicit Door(Duration road_clock = 1h, EndpointOptions road_options = options_of(2),
                EndpointOptions vehicle_options = options_of(1, {}, false)) {
    vehicle = pipe.add_host(std::move(vehicle_options));
    road = pipe.add_host(std::move(road_options), road_clock);
    pipe.on_event = [this](std::size_t host, Event& e) {
      if (auto* fate = std::get_if<MessageFate>(&e)) {
        if (host == vehicle) fates[fate->id].push_back({*fate, pipe.now()});
      } else if (auto* message = std::get_if<Message>(&e)) {
        if (host == road) came.push_back({*message, pipe.now(), lives});
      } else if (auto* can = std::get_if<CanSend>(&e)) {
        can_send.push_back(*can);
      } else if (std::holds_alternative<PeerLost>(e) && host == road) {
        ++lives;
        forgotten.push_back(pipe.now());
      }
    };
    peer = pipe.connect(vehicle, road);
    pipe.run(3s);
    back = pipe.at(road).peers().at(0);
  }

  SendResult send(Variants variants, const SendOptions& options = {}) {
    const SendResult result =
        pipe.at(vehicle).send(pipe.local(vehicle), peer, std::move(variants), options);
    if (result.accepted()) sent[result.id] = {pipe.now(), options.deadline};
    pipe.flush(vehicle);
    return result;
  }
  // The one fate of a message; fails the test where there is not exactly one.
  MessageFate fate(SendId id) {
    EXPECT_EQ(fates[id].size(), 1U);
    return fates[id].empty() ? MessageFate{} : fates[id].front().what;
  }
};

}  // namespace interneuron
