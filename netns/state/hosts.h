// The hosts of a testbed and their names. Pure; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace interneuron::netns {

// One host of a testbed, which is one network namespace.
struct Host {
  enum class Kind : std::uint8_t { kVehicle, kRoad, kCore } kind = Kind::kVehicle;
  // Counted from 0 among the hosts of its kind. There is one core.
  std::size_t index = 0;
  bool operator==(const Host&) const = default;
};
inline constexpr Host kVehicle{Host::Kind::kVehicle, 0};
inline constexpr Host kRoad{Host::Kind::kRoad, 0};
inline constexpr Host kCore{Host::Kind::kCore, 0};

// "vehicle" (or "vehicle1"), "vehicle2", ..., "road", "road2", ..., "core".
std::string host_name(Host host);
// The host of such a name. Throws TestbedError (2) for anything else.
Host parse_host(const std::string& text);

}  // namespace interneuron::netns
