// The vehicles of shards_bench: Endpoints with a socket for each link, and one loop for all.
#pragma once

#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bench/shards_options.h"
#include "interneuron/endpoint.h"
#include "interneuron/sizes.h"
#include "node/io/address.h"
#include "node/io/file_descriptor.h"
#include "node/io/steady_clock.h"

namespace interneuron::bench {

struct Tally {
  std::size_t sent = 0;
  std::size_t delivered = 0;
  std::size_t refused = 0;
  std::size_t other = 0;
};

// A UDP socket from 127.(1 + link).x.y to the roadside unit.
inline io::FileDescriptor connected_socket(std::size_t vehicle, std::uint8_t link,
                                           const Address& road) {
  io::FileDescriptor fd(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  const auto from =
      *make_address(fmt::format("127.{}.{}.{}", 1 + link, vehicle / 200, 1 + vehicle % 200), 0);
  sockaddr_in own{};
  sockaddr_in peer{};
  std::memcpy(&own, from.raw.data(), sizeof own);
  std::memcpy(&peer, road.raw.data(), sizeof peer);
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0 ||
      ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&peer), sizeof peer) != 0) {
    throw std::runtime_error("a vehicle's socket cannot be opened");
  }
  return fd;
}

class Vehicle {
 public:
  Vehicle(const Options& o, TimePoint now, std::size_t number, const Fleet& fleet,
          std::span<const std::uint16_t> ports)
      : o_(o) {
    EndpointOptions options;
    std::random_device random;
    while (options.session.value == 0) options.session.value = random();
    options.policies = builtin_policies();
    if (!o.clear) options.security = security_of(fleet.vehicles[number], {&fleet.road, 1});
    endpoint_ = std::make_unique<Endpoint>(std::move(options), now);
    std::vector<std::pair<LinkId, Address>> addresses;
    for (std::uint8_t i = 0; i < o.links; ++i) {
      const Address road = *make_address(link_address(i), ports[i]);
      sockets_.push_back(connected_socket(number, i, road));
      roads_.push_back(road);
      endpoint_->add_link(now, LinkId{i}, {"lo", 1500, {}});
      addresses.emplace_back(LinkId{i}, road);
    }
    peer_ = endpoint_->connect(now, addresses);
  }
  int socket(std::uint8_t link) const { return sockets_[link].get(); }
  bool is_ready() const { return is_ready_; }
  // From then on messages are sent, and what becomes of them is counted.
  void begin(TimePoint at) { next_message_ = at; }
  void end() { next_message_ = TimePoint::max(); }

  void receive(std::uint8_t link) {
    std::array<std::byte, kMaxDatagramBytes> buffer;
    for (int i = 0; i < 64; ++i) {
      const auto size = ::recv(socket(link), buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (size <= 0) return;
      const auto bytes = static_cast<std::size_t>(size);
      endpoint_->handle_datagram(io::now(),
                                 {LinkId{link}, roads_[link], ByteView(buffer).first(bytes)});
    }
  }
  // Does what is due, and tells when there is more to do.
  TimePoint step(Tally& tally) {
    const TimePoint now = io::now();
    const auto due = endpoint_->next_timeout();
    if (due && *due <= now) endpoint_->handle_timeout(now);
    if (next_message_ <= now) {
      next_message_ += seconds(1 / o_.hertz);
      send(now, tally);
    }
    while (const auto event = endpoint_->poll_event()) {
      if (std::holds_alternative<PeerReady>(*event)) is_ready_ = true;
      const auto* fate = std::get_if<MessageFate>(&*event);
      if (fate != nullptr) ++(fate->fate == Fate::kDelivered ? tally.delivered : tally.other);
    }
    std::array<std::byte, kMaxDatagramBytes> buffer;
    while (const auto t = endpoint_->poll_transmit(io::now(), buffer)) {
      (void)::send(socket(static_cast<std::uint8_t>(t->link.value)), buffer.data(), t->size, 0);
    }
    return std::min(endpoint_->next_timeout().value_or(TimePoint::max()), next_message_);
  }

 private:
  void send(TimePoint now, Tally& tally) {
    Variants variants;
    variants.push_back(Bytes(o_.bytes));
    const auto result = endpoint_->send(now, peer_, std::move(variants),
                                        {.deadline = seconds(o_.deadline_ms / 1e3)});
    ++tally.sent;
    if (result.status != SendStatus::kAccepted) ++tally.refused;
  }

  const Options& o_;
  std::unique_ptr<Endpoint> endpoint_;
  std::vector<io::FileDescriptor> sockets_;
  std::vector<Address> roads_;
  PeerId peer_{};
  bool is_ready_ = false;
  TimePoint next_message_ = TimePoint::max();
};

class Players {
 public:
  explicit Players(const Options& o) : o_(o), epoll_(::epoll_create1(EPOLL_CLOEXEC)) {}

  void add(std::unique_ptr<Vehicle> vehicle) {
    const std::size_t number = vehicles_.size();
    for (std::uint8_t link = 0; link < o_.links; ++link) {
      epoll_event event{.events = EPOLLIN, .data = {.u64 = number * o_.links + link}};
      ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, vehicle->socket(link), &event);
    }
    vehicles_.push_back(std::move(vehicle));
    wakes_.push_back(TimePoint::max());
    step(number);
  }
  void run_until(TimePoint end) {
    while (io::now() < end) {
      const TimePoint next = order_.empty() ? end : std::min(end, order_.begin()->first);
      const Duration wait = std::clamp<Duration>(next - io::now(), 0ns, 1s);
      const timespec timeout{.tv_sec = 0, .tv_nsec = std::min<long>(wait.count(), 999'999'999)};
      std::array<epoll_event, 64> events{};
      const int count =
          ::epoll_pwait2(epoll_.get(), events.data(), events.size(), &timeout, nullptr);
      for (int i = 0; i < count; ++i) {
        const std::uint64_t which = events[static_cast<std::size_t>(i)].data.u64;
        vehicles_[which / o_.links]->receive(static_cast<std::uint8_t>(which % o_.links));
        step(which / o_.links);
      }
      while (!order_.empty() && order_.begin()->first <= io::now()) step(order_.begin()->second);
    }
  }
  // The vehicles send evenly spread over a period.
  void begin() {
    tally = {};
    const double between = 1 / o_.hertz / static_cast<double>(vehicles_.size());
    for (std::size_t i = 0; i < vehicles_.size(); ++i) {
      vehicles_[i]->begin(io::now() + seconds(between * static_cast<double>(i)));
      step(i);
    }
  }
  void end() {
    for (const auto& vehicle : vehicles_) vehicle->end();
  }
  std::size_t ready() const {
    return static_cast<std::size_t>(std::ranges::count_if(vehicles_, &Vehicle::is_ready));
  }
  Tally tally;

 private:
  void step(std::size_t number) {
    order_.erase({wakes_[number], number});
    wakes_[number] = vehicles_[number]->step(tally);
    order_.emplace(wakes_[number], number);
  }

  const Options& o_;
  io::FileDescriptor epoll_;
  std::vector<std::unique_ptr<Vehicle>> vehicles_;
  std::vector<TimePoint> wakes_;
  std::set<std::pair<TimePoint, std::size_t>> order_;
};

}  // namespace interneuron::bench
