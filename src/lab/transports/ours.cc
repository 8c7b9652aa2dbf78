// Interneuron on both ends: Node and its plain door.
#include <atomic>
#include <exception>
#include <memory>
#include <thread>

#include "app/process/failure.h"
#include "app/process/signals.h"
#include "interneuron/node.h"
#include "lab/transports/ends.h"
#include "node/io/steady_clock.h"

namespace interneuron::transports {
namespace {

using namespace std::chrono_literals;

// For all vehicles to be heard. No measurement behind this value: it only has to be long for 200 of
// them on a loaded machine.
constexpr Duration kPatience = 30s;
constexpr Duration kLook = 10ms;

// The keys of this end, which trusts the ends from `first` on, as the order numbers them.
void set_keys(const Order& order, std::size_t own, std::size_t first, std::size_t trusted,
              NodeOptions& options) {
  options.insecure = order.keys.empty();
  if (options.insecure) return;
  auto security = std::make_shared<Security>();
  security->key = order.keys.at(own);
  for (std::size_t i = first; i < first + trusted; ++i) {
    security->peers.push_back({public_key_of(order.keys.at(i)), {}});
  }
  options.security = security;
}

// One vehicle: a Node whose loop has a thread of its own.
class Vehicle {
 public:
  Vehicle(const Order& order, std::uint32_t number)
      : order_(order), number_(number), node_(options(order, number)) {
    node_.on_peer_ready([this](PeerReady) { heard_ = true; });
    loop_ = std::thread([this] { run(); });
  }
  ~Vehicle() {
    node_.stop();
    if (loop_.joinable()) loop_.join();
  }
  Vehicle(const Vehicle&) = delete;
  Vehicle& operator=(const Vehicle&) = delete;

  // Begins to talk to the roadside unit then.
  void join(TimePoint at) {
    node_.post([this, at] { node_.at(at, [this] { connect(); }); });
  }
  // It has met the roadside unit. Throws what its loop threw.
  bool heard() const {
    if (failed_) std::rethrow_exception(failure_);
    return heard_;
  }
  void begin(TimePoint first, TimePoint end) {
    node_.post([this, first, end] { send_at(first, end); });
  }
  // Ends the loop and tells when messages were handed over.
  std::vector<TimePoint> end() {
    node_.stop();
    loop_.join();
    if (failed_) std::rethrow_exception(failure_);
    return std::move(begun_);
  }

 private:
  static NodeOptions options(const Order& order, std::uint32_t number) {
    NodeOptions out;
    set_keys(order, 1 + number, 0, 1, out);
    out.transport = order.transport.datagrams;
    for (std::size_t i = 0; i < order.modems.size(); ++i) {
      NodeLink link{.id = LinkId{static_cast<std::uint8_t>(i)},
                    .nic = order.modems[i].nic,
                    .local_address = order.modems[i].vehicle_address};
      out.links.push_back(std::move(link));
    }
    return out;
  }

  void connect() {
    const std::string port = ":" + std::to_string(kLoadPort);
    std::vector<std::pair<LinkId, Address>> addresses;
    for (std::size_t i = 0; i < order_.modems.size(); ++i) {
      const auto address = parse_address(order_.modems[i].road_address + port);
      addresses.emplace_back(LinkId{static_cast<std::uint8_t>(i)}, address.value());
    }
    peer_ = node_.connect(addresses);
  }

  void run() {
    try {
      node_.run();
    } catch (...) {
      failure_ = std::current_exception();
      failed_ = true;
    }
  }

  void send_at(TimePoint at, TimePoint end) {
    if (at >= end) return;
    node_.at(at, [this, at, end] {
      send();
      send_at(at + order_.traffic.period, end);
    });
  }

  // What is refused was handed over all the same: it is a message that was missed.
  void send() {
    Variants variants;
    const auto number = static_cast<std::uint32_t>(begun_.size());
    for (const std::size_t bytes : order_.traffic.variant_bytes) {
      variants.push_back(message_of(number_, number, bytes));
    }
    SendOptions options{.deadline = order_.traffic.deadline, .policy = order_.transport.mode};
    begun_.push_back(node_.now());
    if (peer_) node_.send(*peer_, std::move(variants), options);
  }

  const Order& order_;
  std::uint32_t number_;
  Node node_;
  // From when it has joined; only the loop's thread touches it.
  std::optional<PeerId> peer_;
  std::atomic<bool> heard_ = false;
  // failure_ is written before failed_ is set.
  std::atomic<bool> failed_ = false;
  std::exception_ptr failure_;
  // Only the loop's thread touches it while that runs.
  std::vector<TimePoint> begun_;
  std::thread loop_;
};

using Vehicles = std::vector<std::unique_ptr<Vehicle>>;

// Those that join by `until`.
void await(const Vehicles& vehicles, const std::vector<Duration>& joins, Duration until) {
  const TimePoint patience = io::now() + kPatience;
  for (std::size_t v = 0; v < vehicles.size();) {
    if (joins[v] > until || vehicles[v]->heard()) {
      ++v;
      continue;
    }
    if (io::now() > patience) {
      throw process::Failure(process::kFailed,
                             "vehicle " + std::to_string(v + 1) + " does not reach the roadside");
    }
    process::SignalWatch::sleep(kLook);
  }
}

}  // namespace

VehiclesRecord send_ours(const Order& order, const Begin& ready) {
  const Traffic& traffic = order.traffic;
  Vehicles vehicles;
  for (std::size_t v = 0; v < traffic.vehicles(); ++v) {
    vehicles.push_back(std::make_unique<Vehicle>(order, static_cast<std::uint32_t>(v)));
    process::SignalWatch::check();
  }
  // The first ones have met the roadside unit when the others follow one after the other.
  std::vector<Duration> joins = traffic.joins;
  joins.resize(traffic.vehicles());
  for (std::size_t v = 0; v < vehicles.size(); ++v) {
    if (joins[v] == Duration{}) vehicles[v]->join(io::now());
  }
  await(vehicles, joins, {});
  const TimePoint met = io::now();
  for (std::size_t v = 0; v < vehicles.size(); ++v) {
    if (joins[v] > Duration{}) vehicles[v]->join(met + joins[v]);
  }
  const TimePoint begin = ready();
  for (std::size_t v = 0; v < traffic.vehicles(); ++v) {
    vehicles[v]->begin(begin + traffic.first[v], begin + traffic.length);
  }
  process::SignalWatch::sleep(begin + traffic.length + traffic.deadline - io::now());
  await(vehicles, joins, Duration::max());
  VehiclesRecord record;
  for (const auto& vehicle : vehicles) record.begun.push_back(vehicle->end());
  return record;
}

void receive_ours(const Order& order, const Ready& ready, Reception& reception) {
  NodeOptions options;
  set_keys(order, 0, 1, order.traffic.vehicles(), options);
  options.transport = order.transport.datagrams;
  for (std::size_t i = 0; i < order.modems.size(); ++i) {
    NodeLink link{.id = LinkId{static_cast<std::uint8_t>(i)}, .nic = order.modems[i].nic};
    options.links.push_back(std::move(link));
  }
  options.port = kLoadPort;
  options.accept_peers = true;
  options.max_peers = order.traffic.vehicles();
  Node node(options);
  node.on_message([&](const Message& message) {
    if (const auto head = read_head(message.bytes)) {
      reception.arrived(*head, message.variant, node.now());
    }
  });
  node.stop_on_signals();
  ready();
  node.run();
}

}  // namespace interneuron::transports
