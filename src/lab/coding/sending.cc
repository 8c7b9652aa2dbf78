#include "lab/coding/sending.h"

#include <algorithm>

#include "interneuron/policy.h"
#include "lab/emu/link.h"

namespace interneuron::coding {
namespace {

// A message begins with its number.
constexpr std::size_t kNumberBytes = 4;

LinkId id(std::size_t link) { return LinkId{static_cast<std::uint8_t>(link)}; }

std::size_t number_of(const Bytes& bytes) {
  std::size_t number = 0;
  for (std::size_t i = 0; i < kNumberBytes; ++i) {
    number |= std::to_integer<std::size_t>(bytes[i]) << (8 * i);
  }
  return number;
}

}  // namespace

Sending::Sending(const std::vector<emu::LinkProfile>& links, const Traffic& traffic,
                 std::uint64_t seed)
    : traffic_(traffic), world_(seed), got_(traffic.messages), links_(links.size()) {
  EndpointOptions options;
  options.policies = builtin_policies();
  options.session = SessionId{1};
  vehicle_ = world_.add_host(options);
  options.session = SessionId{2};
  options.accept_peers = true;
  road_ = world_.add_host(options);
  for (std::size_t i = 0; i < links_; ++i) {
    world_.add_link(vehicle_, road_, id(i), links[i].name,
                    emu::Link(links[i], emu::link_seed(seed, i)));
  }
  world_.on_event([this](sim::HostId host, Event&& event) { note(host, event); });
  peer_ = world_.connect(vehicle_, road_);
}

void Sending::note(sim::HostId host, const Event& event) {
  const auto* message = std::get_if<Message>(&event);
  if (message != nullptr && host == road_) got_.at(number_of(message->bytes)) = message->variant;
}

void Sending::hole(Duration from, Duration length) {
  world_.outage(world_.wire_of(id(0)), from, length);
}

void Sending::run() {
  const auto count = static_cast<std::int64_t>(got_.size());
  for (std::int64_t i = 0; i < count; ++i) {
    world_.at(kBegin + i * traffic_.period, [this, i] { send(static_cast<std::size_t>(i)); });
  }
  world_.run_until(kBegin - Duration{1});
  const std::uint64_t before = bytes_so_far();
  world_.run_until(kBegin + count * traffic_.period + traffic_.deadline);
  bytes_ = bytes_so_far() - before;
}

std::size_t Sending::missed() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(got_, [](const auto& variant) { return !variant; }));
}

std::size_t Sending::degraded() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(got_, [](const auto& variant) { return variant && *variant > 0; }));
}

void Sending::send(std::size_t number) {
  Variants variants;
  for (const std::size_t size : traffic_.variants) {
    Bytes& bytes = variants.emplace_back(std::max(size, kNumberBytes));
    for (std::size_t i = 0; i < kNumberBytes; ++i) {
      bytes[i] = static_cast<std::byte>(number >> (8 * i));
    }
  }
  SendOptions options;
  options.policy = traffic_.policy;
  options.deadline = traffic_.deadline;
  world_.endpoint(vehicle_).send(world_.local_time(vehicle_), peer_, std::move(variants), options);
  world_.flush(vehicle_);
}

std::uint64_t Sending::bytes_so_far() const {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < links_; ++i) sum += world_.stats(id(i), true).bytes_in;
  return sum;
}

}  // namespace interneuron::coding
