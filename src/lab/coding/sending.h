// A vehicle that sends messages to a roadside unit over emulated links, in virtual time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lab/emu/profile.h"
#include "lab/sim/world.h"

namespace interneuron::coding {

// What is sent: messages of these variants (bytes, the best first), one every `period`.
struct Traffic {
  std::string policy;
  std::vector<std::size_t> variants;
  Duration period{};
  Duration deadline{};
  std::size_t messages = 0;
};

// One run, with the production code (Endpoint::send()) over one link for each profile; the same
// arguments give the same run. Pure; thread-compatible. Errors: std::invalid_argument for a policy
// that there is not.
class Sending {
 public:
  Sending(const std::vector<emu::LinkProfile>& links, const Traffic& traffic, std::uint64_t seed);

  // The first message leaves then; both ends know their links by then.
  static constexpr Duration kBegin = std::chrono::seconds(2);

  // Nothing passes over the first link in [from, from + length).
  void hole(Duration from, Duration length);
  // To the deadline of the last message; call it once.
  void run();

  // The variant of each message that was delivered in time.
  const std::vector<std::optional<std::uint8_t>>& got() const { return got_; }
  std::size_t missed() const;
  std::size_t degraded() const;
  // IP bytes that left the vehicle by its modems from the first message on, with repairs, symbols,
  // probes, feedback and heartbeats.
  std::uint64_t bytes() const { return bytes_; }

 private:
  void note(sim::HostId host, const Event& event);
  void send(std::size_t number);
  std::uint64_t bytes_so_far() const;

  Traffic traffic_;
  sim::World world_;
  std::vector<std::optional<std::uint8_t>> got_;
  sim::HostId vehicle_ = 0;
  sim::HostId road_ = 0;
  PeerId peer_{};
  std::size_t links_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace interneuron::coding
