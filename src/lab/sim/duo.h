// A vehicle and a roadside unit over any links, in virtual time, and a stream of plain messages
// from one to the other, with the production code (Endpoint::send()). What most runs and tests of a
// World begin with. The same arguments give the same run. Pure; thread-compatible. Errors:
// std::invalid_argument for a policy that there is not.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lab/emu/profile.h"
#include "lab/sim/world.h"

namespace interneuron::sim {

// A message whose variants have these sizes, at least eight bytes each. All begin with `number`, by
// which the receiver knows it.
Variants numbered(const std::vector<std::size_t>& bytes, std::uint64_t number);
std::uint64_t number_of(const Bytes& message);

class Duo {
 public:
  struct Options {
    std::string policy = "best_link";
    // Bytes of each variant of a message, the best first.
    std::vector<std::size_t> variants{128 * 1024};
    Duration deadline = std::chrono::milliseconds(100);
    Duration period = std::chrono::milliseconds(100);
    // The MTU of both hosts' NIC on each link; 1500 where the list is shorter.
    std::vector<std::size_t> nic_mtus{};
    // What the vehicle knows of the NIC of each link; nothing where the list is shorter.
    std::vector<LinkTraits> traits{};
    std::uint64_t seed = 1;
  };

  // One link for each profile, with LinkId 0, 1, ... `vehicle` and `road` are what the endpoints
  // are beside their sessions (1 and 2) and that the road accepts peers; without policies they have
  // the built-in ones.
  Duo(const std::vector<emu::LinkProfile>& links, Options options, EndpointOptions vehicle = {},
      EndpointOptions road = {});
  virtual ~Duo() = default;
  // The world's handlers refer to it.
  Duo(const Duo&) = delete;
  Duo& operator=(const Duo&) = delete;

  // Both ends know their links by then.
  static constexpr Duration kBegin = std::chrono::seconds(2);

  // Plans `count` messages, the first of which leaves at `from`.
  void send(Duration from, std::size_t count);
  // Runs to a period after the deadline of the last message, and a little more for what is told of
  // it afterwards.
  void run() { world.run_until(end_ + std::chrono::milliseconds(200)); }
  // Runs to a period after the deadline of the last message. Returns the IP bytes that left the
  // vehicle by its modems from the first message on, with repairs, symbols, probes, feedback and
  // heartbeats.
  std::uint64_t run_counting();

  // How many of the messages [first, last) have not arrived in time in any variant, or only in a
  // smaller one.
  std::size_t missed(std::size_t first = 0, std::size_t last = SIZE_MAX) const;
  std::size_t degraded(std::size_t first = 0, std::size_t last = SIZE_MAX) const;
  // What an end knows of a link now.
  LinkState link(std::uint8_t id, bool at_road = false);

  struct Change {
    Duration at{};
    HostId host = 0;
    PathChanged what;
  };

  World world;
  HostId vehicle = 0;
  HostId road = 0;
  PeerId peer{};
  // The variant of each message that was delivered in time.
  std::vector<std::optional<std::uint8_t>> got;
  // What both ends were told of their paths.
  std::vector<Change> changes;

 protected:
  // What either endpoint tells.
  virtual void handle(HostId host, Event&& event);

 private:
  void send_one(std::size_t number);
  std::uint64_t bytes_up() const;

  Options options_;
  std::size_t links_;
  Duration begin_{};
  Duration end_{};
};

}  // namespace interneuron::sim
