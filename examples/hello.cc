// A message with a deadline goes from a vehicle to a roadside unit, and its answer comes back, on
// the loopback card.
#include <interneuron/node.h>

#include <cstdio>
#include <thread>

namespace in = interneuron;

in::Bytes to_bytes(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

int main() {
  in::NodeOptions options;
  options.links = {{.id = {1}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  in::Node road(options);
  road.on_delivered([&](in::Delivered m) {
    road.submit(m.round, {to_bytes("hello, vehicle")}, in::MessageClass::kResult);
  });
  std::thread road_loop([&] { road.run(); });

  options.links[0].peer = to_string(*road.local_address({1}));
  options.pipelines = {{.stages = in::offload_stages()}};
  in::Node vehicle(options);
  vehicle.on_peer_ready([&](in::PeerReady) {
    vehicle.submit(vehicle.begin_round({}), {to_bytes("hello")}, in::MessageClass::kData);
  });
  vehicle.on_round_done([&](in::RoundDone done) {  // by the deadline, answered or not
    const char* text = reinterpret_cast<const char*>(done.result.data());
    std::printf("%.2f ms: %.*s\n", in::to_ms(done.e2e), static_cast<int>(done.result.size()), text);
    vehicle.stop();
  });
  vehicle.run();
  road.stop();
  road_loop.join();
}
