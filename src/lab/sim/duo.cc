#include "lab/sim/duo.h"

#include <algorithm>
#include <cstring>

namespace interneuron::sim {
namespace {

LinkId id(std::size_t link) { return LinkId{static_cast<std::uint8_t>(link)}; }

EndpointOptions with_session(EndpointOptions options, std::uint32_t session) {
  options.session = SessionId{session};
  if (options.policies.empty()) options.policies = builtin_policies();
  return options;
}

// How many of all[first, last) are as `what` says.
template <class Range, class What>
std::size_t count(const Range& all, std::size_t first, std::size_t last, const What& what) {
  const auto end = static_cast<std::ptrdiff_t>(std::min(last, all.size()));
  return static_cast<std::size_t>(
      std::count_if(all.begin() + static_cast<std::ptrdiff_t>(first), all.begin() + end, what));
}

}  // namespace

Variants numbered(const std::vector<std::size_t>& bytes, std::uint64_t number) {
  Variants out;
  for (const std::size_t size : bytes) {
    Bytes& variant = out.emplace_back(std::max(size, sizeof number));
    std::memcpy(variant.data(), &number, sizeof number);
  }
  return out;
}

std::uint64_t number_of(const Bytes& message) {
  std::uint64_t number = 0;
  std::memcpy(&number, message.data(), sizeof number);
  return number;
}

Duo::Duo(const std::vector<emu::LinkProfile>& links, Options options, EndpointOptions of_vehicle,
         EndpointOptions of_road)
    : world(options.seed), options_(std::move(options)), links_(links.size()) {
  of_road.accept_peers = true;
  vehicle = world.add_host(with_session(std::move(of_vehicle), 1));
  road = world.add_host(with_session(std::move(of_road), 2));
  for (std::size_t i = 0; i < links_; ++i) {
    if (i < options_.nic_mtus.size()) {
      for (const HostId host : {vehicle, road}) {
        world.add_nic(host, id(i), {links[i].name, options_.nic_mtus[i], {}});
      }
    }
    world.add_link(vehicle, road, id(i), links[i].name,
                   emu::Link(links[i], emu::link_seed(options_.seed, i)),
                   i < options_.traits.size() ? options_.traits[i] : LinkTraits{});
  }
  world.on_event([this](HostId host, Event&& event) { handle(host, std::move(event)); });
  peer = world.connect(vehicle, road);
}

void Duo::handle(HostId host, Event&& event) {
  if (const auto* message = std::get_if<Message>(&event); message != nullptr && host == road) {
    got.at(number_of(message->bytes)) = message->variant;
  } else if (auto* change = std::get_if<PathChanged>(&event)) {
    changes.push_back({world.now(), host, std::move(*change)});
  }
}

void Duo::send(Duration from, std::size_t count) {
  got.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    world.at(from + static_cast<std::int64_t>(i) * options_.period, [this, i] { send_one(i); });
  }
  begin_ = from;
  end_ = from + static_cast<std::int64_t>(count) * options_.period + options_.deadline;
}

void Duo::send_one(std::size_t number) {
  SendOptions how{.deadline = options_.deadline, .policy = options_.policy};
  world.endpoint(vehicle).send(world.local_time(vehicle), peer, numbered(options_.variants, number),
                               how);
  world.flush(vehicle);
}

std::size_t Duo::missed(std::size_t first, std::size_t last) const {
  return count(got, first, last, [](const auto& variant) { return !variant; });
}

std::size_t Duo::degraded(std::size_t first, std::size_t last) const {
  return count(got, first, last, [](const auto& variant) { return variant && *variant > 0; });
}

std::uint64_t Duo::run_counting() {
  world.run_until(begin_ - Duration{1});
  const std::uint64_t before = bytes_up();
  world.run_until(end_);
  return bytes_up() - before;
}

// IP bytes that the vehicle has put on its links so far.
std::uint64_t Duo::bytes_up() const {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < links_; ++i) sum += world.stats(id(i), true).bytes_in;
  return sum;
}

LinkState Duo::link(std::uint8_t id, bool at_road) {
  const HostId host = at_road ? road : vehicle;
  const PeerId other = at_road ? world.endpoint(road).peers().at(0) : peer;
  for (const LinkState& state : world.endpoint(host).links(world.local_time(host), other)) {
    if (state.id == LinkId{id}) return state;
  }
  return {};
}

}  // namespace interneuron::sim
