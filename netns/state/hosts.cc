// host_name() and parse_host() of hosts.h, backend_name() of state.h.
#include "netns/state/hosts.h"

#include <charconv>
#include <optional>

#include "netns/state/error.h"
#include "netns/state/state.h"

namespace interneuron::netns {

namespace {

constexpr const char* kVehicleName = "vehicle";
constexpr const char* kRoadName = "road";
constexpr const char* kCoreName = "core";

// The index of a host whose name ends in these digits: 0 for "" and "1", 1 for "2", and so on.
std::optional<std::size_t> parse_index(const std::string& digits) {
  if (digits.empty()) return 0;
  std::size_t number = 0;
  const char* const end = digits.data() + digits.size();
  const auto [rest, error] = std::from_chars(digits.data(), end, number);
  if (error != std::errc{} || rest != end || digits[0] == '0') return std::nullopt;
  return number - 1;
}

}  // namespace

std::string host_name(Host host) {
  if (host.kind == Host::Kind::kCore) return kCoreName;
  const std::string kind = host.kind == Host::Kind::kVehicle ? kVehicleName : kRoadName;
  return host.index == 0 ? kind : kind + std::to_string(host.index + 1);
}

Host parse_host(const std::string& text) {
  if (text == kCoreName) return kCore;
  for (const Host first : {kVehicle, kRoad}) {
    const std::string kind = host_name(first);
    if (!text.starts_with(kind)) continue;
    if (const auto index = parse_index(text.substr(kind.size()))) return {first.kind, *index};
  }
  throw TestbedError(
      2, "no host '" + text + "'; hosts are called vehicle, vehicle2, ..., road, road2, ..., core");
}

const char* backend_name(Backend backend) {
  switch (backend) {
    case Backend::kAuto:
      return "auto";
    case Backend::kNetem:
      return "netem";
    case Backend::kEmulator:
      break;
  }
  return "emulator";
}

}  // namespace interneuron::netns
