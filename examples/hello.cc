// A message with a deadline goes from one node to another, encrypted, on the loopback card, and the
// sender learns what became of it.
#include <interneuron/node.h>

#include <cstdio>
#include <thread>

namespace in = interneuron;

// Each host has a private key and trusts the public keys of others; `interneuron keys` makes files.
std::shared_ptr<in::Security> trusting(const in::SecretKey& own, const in::SecretKey& other) {
  auto security = std::make_shared<in::Security>();
  security->key = own;
  security->peers = {{.key = public_key_of(other)}};
  return security;
}

int main() {
  const in::SecretKey road_key = in::random_key();
  const in::SecretKey vehicle_key = in::random_key();
  in::NodeOptions options;
  options.links = {{.id = {1}, .nic = "lo", .local_address = "127.0.0.1"}};
  options.accept_peers = true;
  options.security = trusting(road_key, vehicle_key);
  in::Node road(options);
  road.on_message([](const in::Message& m) {
    const char* text = reinterpret_cast<const char*>(m.bytes.data());
    std::printf("road: %.*s\n", static_cast<int>(m.bytes.size()), text);
  });
  std::thread road_loop([&] { road.run(); });

  options.links[0].peer = to_string(*road.local_address({1}));
  options.accept_peers = false;
  options.security = trusting(vehicle_key, road_key);
  in::Node vehicle(options);
  vehicle.on_peer_ready([&](in::PeerReady p) {
    const auto hello = std::as_bytes(std::span("hello", 5));
    vehicle.send(p.peer, in::Bytes(hello.begin(), hello.end()),
                 {.deadline = std::chrono::milliseconds(100)});
  });
  vehicle.on_fate([&](const in::MessageFate& fate) {  // exactly one per message
    std::printf("vehicle: %s after %.2f ms\n", to_string(fate.fate).data(), in::to_ms(fate.age));
    vehicle.stop();
  });
  vehicle.run();
  road.stop();
  road_loop.join();
}
