// Pieces of a message that come one by one are read together, a few at a time, until the message is
// nearly whole; the kernel's stamps tell when each came. Between two nodes on the loopback card, of
// which one spaces what it sends.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>
#include <vector>

#include "interneuron/node.h"
#include "node/io/steady_clock.h"

namespace interneuron::gather_test {
namespace {

using namespace std::chrono_literals;

constexpr LinkId kLink{1};
constexpr std::size_t kMessageBytes = 100'000;
constexpr std::size_t kLeastPieces = kMessageBytes / 1'500;
// Smaller than any piece but the last, larger than anything else.
constexpr std::size_t kPieceBytes = 1'000;
constexpr Duration kSpacing = 300us;
constexpr std::size_t kMessages = 10;

class Wrapper : public Transport {
 public:
  explicit Wrapper(std::unique_ptr<Transport> inner) : inner_(std::move(inner)) {}
  BatchResult send(std::span<const Outgoing> batch) override { return inner_->send(batch); }
  std::span<const Incoming> receive() override { return inner_->receive(); }
  bool drained() const override { return inner_->drained(); }
  TransportCaps capabilities() const override { return inner_->capabilities(); }
  TransportCounters counters() const override { return inner_->counters(); }
  Address local_address() const override { return inner_->local_address(); }
  int native_handle() const override { return inner_->native_handle(); }

 protected:
  std::unique_ptr<Transport> inner_;
};

// Sends one datagram at a time, none soon after another one.
class Spaced final : public Wrapper {
 public:
  using Wrapper::Wrapper;
  BatchResult send(std::span<const Outgoing> batch) override {
    for (std::size_t i = 0; i < batch.size(); ++i) {
      while (io::now() < next_) continue;
      next_ = io::now() + kSpacing;
      const BatchResult result = inner_->send(batch.subspan(i, 1));
      if (result.taken == 0) return {i, result.would_block, result.gone};
    }
    return {batch.size(), false, 0};
  }

 private:
  TimePoint next_ = TimePoint::min();
};

// Pieces that were read together: when the first and the last came, how many, and when they were
// read.
struct Reading {
  TimePoint first{};
  TimePoint last{};
  std::size_t pieces = 0;
  TimePoint at{};
};

class Noting final : public Wrapper {
 public:
  Noting(std::unique_ptr<Transport> inner, std::vector<Reading>& readings)
      : Wrapper(std::move(inner)), readings_(readings) {}
  std::span<const Incoming> receive() override {
    const auto batch = inner_->receive();
    Reading reading;
    reading.at = io::now();
    for (const Incoming& datagram : batch) {
      if (datagram.bytes.size() < kPieceBytes) continue;
      if (reading.pieces++ == 0) reading.first = datagram.at;
      reading.last = datagram.at;
    }
    if (reading.pieces > 0) readings_.push_back(reading);
    return batch;
  }

 private:
  std::vector<Reading>& readings_;
};

NodeOptions on_loopback() {
  NodeOptions options;
  options.insecure = true;
  options.links = {{.id = kLink, .nic = "lo", .local_address = "127.0.0.1"}};
  return options;
}

// The readings of each message, sent one after the other; those of packets that measure the path
// come before.
std::vector<std::vector<Reading>> readings_of_messages() {
  std::vector<Reading> readings;
  std::vector<std::vector<Reading>> out;
  NodeOptions options = on_loopback();
  options.accept_peers = true;
  options.wrap_transport = [&readings](LinkId, std::unique_ptr<Transport> inner) {
    return std::make_unique<Noting>(std::move(inner), readings);
  };
  Node road(std::move(options));
  options = on_loopback();
  options.links[0].peer = to_string(*road.local_address(kLink));
  options.wrap_transport = [](LinkId, std::unique_ptr<Transport> inner) {
    return std::make_unique<Spaced>(std::move(inner));
  };
  Node vehicle(std::move(options));
  road.on_message([&](const Message&) { out.push_back(std::exchange(readings, {})); });
  std::thread loop([&road] { road.run(); });
  std::size_t sent = 0;
  const std::function<void()> send = [&] {
    if (sent++ == kMessages) return vehicle.stop();
    vehicle.send(*vehicle.peer(), Bytes(kMessageBytes), {.deadline = 1s});
  };
  vehicle.on_peer_ready([&](PeerReady) { vehicle.after(500ms, send); });
  vehicle.on_fate([&](const MessageFate&) { vehicle.after(50ms, send); });
  vehicle.after(60s, [] { throw std::runtime_error("it took too long"); });
  vehicle.run();
  road.stop();
  loop.join();
  return out;
}

// The best of several messages counts: on a busy machine some do not come spaced as they were sent.
TEST(NodeGathers, PiecesThatComeOneByOneUntilTheMessageIsNearlyWhole) {
  double fewest = 1;
  Duration widest{};
  Duration least_wait = Duration::max();
  for (const std::vector<Reading>& readings : readings_of_messages()) {
    if (readings.empty()) continue;
    std::size_t pieces = 0;
    for (const Reading& reading : readings) {
      pieces += reading.pieces;
      if (reading.pieces < 10) widest = std::max<Duration>(widest, reading.last - reading.first);
    }
    if (pieces < kLeastPieces) continue;
    fewest = std::min(fewest, static_cast<double>(readings.size()) / static_cast<double>(pieces));
    least_wait = std::min<Duration>(least_wait, readings.back().at - readings.back().last);
  }
  EXPECT_LE(fewest, 0.6) << "readings a piece";
  EXPECT_GE(widest, kSpacing * 9 / 10) << "pieces that are read together came apart";
  EXPECT_LT(least_wait, 500us) << "the last piece waits for nothing";
}

}  // namespace
}  // namespace interneuron::gather_test
