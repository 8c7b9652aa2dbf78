// What the two processes of shards_bench agree on.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "interneuron/security.h"
#include "interneuron/units.h"
#include "node/io/steady_clock.h"

namespace interneuron::bench {

using namespace std::chrono_literals;

struct Options {
  std::vector<std::size_t> shards{1, 2};
  std::size_t vehicles = 300;
  std::uint8_t links = 2;
  std::size_t bytes = 5000;
  double hertz = 10;
  double deadline_ms = 100;
  double meet_s = 8;
  double seconds = 10;
  bool clear = false;
};

inline Duration seconds(double s) { return Duration{static_cast<std::int64_t>(s * 1e9)}; }

struct Fleet {
  SecretKey road = random_key();
  std::vector<SecretKey> vehicles;
};

inline std::shared_ptr<const Security> security_of(const SecretKey& own,
                                                   std::span<const SecretKey> peers) {
  auto out = std::make_shared<Security>();
  out->key = own;
  out->seed = random_key();
  out->unix_time_ns = io::unix_time_ns();
  for (const SecretKey& peer : peers) out->peers.push_back({public_key_of(peer), {}});
  return out;
}

inline std::string link_address(std::uint8_t link) { return "127.0.0." + std::to_string(link + 1); }

// --- the vehicles

}  // namespace interneuron::bench
