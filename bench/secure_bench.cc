// What encryption costs: processor time of packets, of handshakes and of what is refused, and the
// memory of sessions; on one thread, without sockets.
//
//   build/release/bench/secure_bench [--bytes N] [--rounds N] [--packets N] [--handshakes N]
//                                    [--peers N] [--portable]
//
// What is compared takes turns within a round, and the least and the median of the rounds are told:
// whatever else the machine does makes a figure larger and never smaller. Only the time in which
// this thread has the processor counts. Packets lie in the cache, as those that have just come in
// do.
#include <fmt/format.h>
#include <malloc.h>
#include <sodium.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>
#include <vector>

#include "bench/secure_parts.h"
#include "core/secure/entropy.h"
#include "core/secure/handshake.h"
#include "core/secure/responder.h"
#include "core/secure/session.h"
#include "core/secure/sessions.h"
#include "core/wire/packet.h"

namespace interneuron::bench {
namespace {

using namespace crypto;
using namespace std::chrono_literals;

// In each direction of a session: as many as a peer may have.
constexpr std::uint16_t kPaths = wire::kMaxReports;
// Handshakes come this far apart in virtual time, so that all are answered without a cookie.
constexpr Duration kBetweenHandshakes = Duration{1s} / Responder::kFreely;
constexpr SessionId kRoadLife{1U << 31U};
constexpr TimePoint kBegin{1h};

struct Options {
  std::size_t bytes = 1400;
  std::size_t rounds = 21;
  std::size_t packets = 6400;
  std::size_t handshakes = 100;
  std::size_t peers = 1000;
  bool portable = false;
};

// --- packets

// Two hosts, what they send each other, and the same by libsodium alone.
class Pair {
 public:
  Pair(const Options& options, Cipher cipher)
      : cipher_(cipher),
        vehicle_(kBegin, Session::Role::kInitiator, 22, keys()),
        road_(kBegin, Session::Role::kResponder, 11, keys()),
        packets_(kBatch, packet(options.bytes, LinkId{3}, 1)),
        opened_(options.bytes),
        alone_(options.bytes, cipher),
        batches_(std::max<std::size_t>(options.packets / kBatch, 1)) {}

  void measure(Table& table) {
    std::array<double, 4> us{};
    for (std::size_t batch = 0; batch < batches_; ++batch) {
      for (Bytes& p : packets_) wire::set_number(p, ++number_);
      us[0] += us_of([&] {
        for (Bytes& p : packets_) expect(vehicle_.seal(p), "a packet was not sealed");
      });
      us[1] += us_of([&] { alone_.seal(); });
      us[2] += us_of([&] {
        for (const Bytes& p : packets_) {
          expect(road_.open(*wire::peek(p), p, opened_) == Session::Opened::kOk,
                 "a packet was not opened");
        }
      });
      us[3] += us_of([&] { alone_.open(); });
    }
    const std::array<const char*, 4> what{"sealed by a session", "sealed by libsodium alone",
                                          "opened by a session", "opened by libsodium alone"};
    for (std::size_t i = 0; i < us.size(); ++i) {
      table.add(fmt::format("{}, {}", name_of(cipher_), what[i]),
                us[i] / static_cast<double>(batches_ * kBatch));
    }
  }

 private:
  Split keys() const { return {key_of(1), key_of(2), cipher_}; }

  Cipher cipher_;
  Session vehicle_;
  Session road_;
  std::vector<Bytes> packets_;
  Bytes opened_;
  Alone alone_;
  std::size_t batches_;
  std::uint64_t number_ = 0;
};

void measure_packets(const Options& options) {
  std::vector<std::unique_ptr<Pair>> pairs;
  for (const Cipher cipher : ciphers(options.portable))
    pairs.push_back(std::make_unique<Pair>(options, cipher));
  Table table;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    for (const auto& pair : pairs) pair->measure(table);
  }
  table.print(fmt::format("µs for a packet of {} bytes", options.bytes));
}

// --- handshakes

void measure_handshakes(const Options& options) {
  const KeyPair road_key = key_pair_of(key_of(1));
  Security security{.key = road_key.secret};
  security.peers.push_back({public_key_of(key_of(2)), {}});
  const Trust trust(security);
  Responder road(road_key, kRoadLife, trust);
  Vehicle vehicle(2, road_key.open);
  Entropy entropy(key_of(3));
  Bytes response(kMaxDatagramBytes);
  TimePoint now = kBegin;
  Table table;
  for (std::size_t round = 0; round < options.rounds; ++round) {
    std::array<double, 3> us{};
    for (std::size_t i = 0; i < options.handshakes; ++i) {
      now += kBetweenHandshakes;
      vehicle.begin(now);
      const Initiator::Fresh fresh{entropy.draw_index(), entropy.draw_key(),
                                   now.time_since_epoch().count()};
      us[0] += us_of([&] { vehicle.ask(now); });
      us[1] += us_of([&] {
        const bool is_new = road.take(now, vehicle.header(), vehicle.datagram(), entropy) ==
                            Responder::Verdict::kNew;
        expect(is_new && road.accept(now, vehicle.header(), vehicle.datagram(), fresh),
               "a handshake was refused");
        response.resize(road.write(response, wire::Token{}));
      });
      us[2] += us_of([&] { expect(vehicle.take(response).has_value(), "an answer was refused"); });
      response.resize(kMaxDatagramBytes);
    }
    const double all = static_cast<double>(options.handshakes);
    table.add("who asks: makes and writes an initiation", us[0] / all);
    table.add("who is asked: takes, accepts and writes a response", us[1] / all);
    table.add("who asks: takes the response", us[2] / all);
    table.add("all of it", (us[0] + us[1] + us[2]) / all);
  }
  table.print("µs for a handshake over one path");
}

// --- memory, and what is refused

// What is taken of malloc, with what malloc keeps beside it.
double heap_bytes() {
  const struct mallinfo2 info = ::mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

// The sessions of an endpoint with many peers, each of which has used kPaths paths both ways.
class Road {
 public:
  Road(const Options& options, const std::vector<TrustedPeer>& vehicles)
      : options_(options), open_(public_key_of(key_of(1))), opened_(kMaxDatagramBytes) {
    Security security{.key = key_of(1), .peers = vehicles, .seed = key_of(0)};
    sessions_ = std::make_unique<Sessions>(security, kRoadLife, true, now_, Ciphers{0});
    indices_.reserve(vehicles.size());
    for (std::uint32_t i = 0; i < vehicles.size(); ++i) join(i);
    // The handshakes are over: what was kept for their further copies goes with the next one.
    now_ += Initiator::kMessageLife;
    later_ = now_;
  }

  void measure_refusals() {
    Table table;
    std::vector<Bytes> known;
    std::vector<Bytes> unused;
    std::vector<Bytes> foreign;
    for (std::size_t i = 0; i < kBatch; ++i) {
      const std::uint32_t index = indices_[i * indices_.size() / kBatch];
      known.push_back(forged(index, LinkId{0}));
      unused.push_back(forged(index, LinkId{kPaths}));
      foreign.push_back(forged(index + 1, LinkId{0}));
    }
    // One whose mac1 is wrong, and one of a stranger who knows our public key.
    Vehicle scanner(2, open_);
    scanner.begin(now_);
    scanner.ask(now_);
    scanner.initiation()[wire::kHeaderBytes] ^= std::byte{1};
    Vehicle stranger(0xffff'ffff, open_);
    stranger.begin(now_);
    stranger.ask(now_);
    for (std::size_t round = 0; round < options_.rounds; ++round) {
      table.add("a packet with a wrong tag, on a path in use", us_of_packets(known));
      table.add("the same on a path that was not used yet", us_of_packets(unused));
      table.add("a packet with the number of no session", us_of_packets(foreign));
      table.add("an initiation with a wrong mac1", us_of_initiations(scanner, options_.packets));
      table.add("an initiation of a stranger who knows our key",
                us_of_initiations(stranger, options_.handshakes));
    }
    table.print("µs for what is refused");
  }

 private:
  void join(std::uint32_t owner) {
    now_ += kBetweenHandshakes;
    // Numbers of keys: 1 is the road's.
    Vehicle vehicle(owner + 2, open_);
    vehicle.begin(now_);
    vehicle.ask(now_);
    sessions_->take_handshake(now_, vehicle.header(), vehicle.datagram());
    const auto next = sessions_->responder().next();
    expect(next.has_value(), "a handshake was refused");
    Bytes response(kMaxDatagramBytes);
    response.resize(sessions_->responder().write(response, wire::Token{}));
    const auto answer = vehicle.take(response);
    expect(answer.has_value(), "an answer was refused");
    Session session(now_, Session::Role::kInitiator, answer->theirs.index, answer->keys);
    for (std::uint16_t path = 0; path < kPaths; ++path) {
      Bytes up = packet(100, LinkId{path}, 1);
      expect(session.seal(up), "a packet was not sealed");
      expect(open(up) == Session::Opened::kOk, "a packet was not opened");
      if (path == 0) sessions_->adopt(owner, next->index);
      Bytes down = packet(100, LinkId{path}, 1);
      expect(sessions_->seal(now_, owner, down), "a packet was not sealed");
    }
    indices_.push_back(next->index);
  }

  Session::Opened open(ByteView bytes) {
    return sessions_->open(now_, *wire::peek(bytes), bytes, opened_).result;
  }

  Bytes forged(std::uint32_t index, LinkId path) const {
    Bytes out = packet(options_.bytes, path, 2);
    wire::mark_sealed(out, SessionId{index});
    return out;
  }

  double us_of_packets(const std::vector<Bytes>& packets) {
    const std::size_t times = std::max<std::size_t>(options_.packets / packets.size(), 1);
    const double us = us_of([&] {
      for (std::size_t i = 0; i < times; ++i) {
        for (const Bytes& p : packets) {
          expect(open(p) == Session::Opened::kForged, "a forged packet was opened");
        }
      }
    });
    return us / static_cast<double>(times * packets.size());
  }

  double us_of_initiations(const Vehicle& from, std::size_t times) {
    const Datagram datagram = from.datagram();
    const double us = us_of([&] {
      for (std::size_t i = 0; i < times; ++i) {
        later_ += kBetweenHandshakes;
        const auto taken = sessions_->take_handshake(later_, *wire::peek(datagram.bytes), datagram);
        expect(!taken.is_used, "an initiation was accepted");
      }
    });
    return us / static_cast<double>(times);
  }

  const Options& options_;
  PublicKey open_;
  Bytes opened_;
  TimePoint now_ = kBegin;
  // The time of initiations that are refused: the sessions, which end, stay behind at now_.
  TimePoint later_ = kBegin;
  std::unique_ptr<Sessions> sessions_;
  std::vector<std::uint32_t> indices_;
};

double session_kib(std::size_t sessions, Cipher cipher) {
  std::vector<std::unique_ptr<Session>> held(sessions);
  Bytes opened(kMaxDatagramBytes);
  const double before = heap_bytes();
  for (std::uint32_t i = 0; i < sessions; ++i) {
    const Split keys{key_of(2 * i), key_of(2 * i + 1), cipher};
    Session other(kBegin, Session::Role::kInitiator, 1, keys);
    held[i] = std::make_unique<Session>(kBegin, Session::Role::kResponder, 1, keys);
    for (std::uint16_t path = 0; path < kPaths; ++path) {
      Bytes up = packet(100, LinkId{path}, 1);
      Bytes down = packet(100, LinkId{path}, 1);
      expect(other.seal(up) && held[i]->seal(down), "a packet was not sealed");
      expect(held[i]->open(*wire::peek(up), up, opened) == Session::Opened::kOk,
             "a packet was not opened");
    }
  }
  return (heap_bytes() - before) / 1024 / static_cast<double>(sessions);
}

void measure_peers(const Options& options) {
  fmt::print("KiB of memory, for each of {}\n", options.peers);
  for (const Cipher cipher : ciphers(options.portable)) {
    fmt::print("  {:<56}{:10.1f}\n",
               fmt::format("a session of {} with {} paths each way", name_of(cipher), kPaths),
               session_kib(options.peers, cipher));
  }
  std::vector<TrustedPeer> vehicles;
  for (std::uint32_t i = 0; i < options.peers; ++i) {
    vehicles.push_back({public_key_of(key_of(i + 2)), {}});
  }
  const double before = heap_bytes();
  Road road(options, vehicles);
  fmt::print("  {:<56}{:10.1f}\n", "a peer that is trusted and has such a session",
             (heap_bytes() - before) / 1024 / static_cast<double>(options.peers));
  road.measure_refusals();
}

}  // namespace
}  // namespace interneuron::bench

int main(int argc, char** argv) {
  using namespace interneuron;
  bench::Options options;
  CLI::App app("What encryption costs: packets, handshakes, what is refused, and memory.");
  app.add_option("--bytes", options.bytes, "Bytes of a packet")
      ->check(CLI::Range(wire::kPacketOverhead, kMaxDatagramBytes));
  app.add_option("--rounds", options.rounds, "Rounds")->check(CLI::PositiveNumber);
  app.add_option("--packets", options.packets, "Packets of each kind in a round")
      ->check(CLI::PositiveNumber);
  app.add_option("--handshakes", options.handshakes, "Handshakes in a round")
      ->check(CLI::PositiveNumber);
  // Beyond these the first session would end before the last one is made.
  app.add_option("--peers", options.peers, "Sessions that are held")->check(CLI::Range(1, 5000));
  app.add_flag("--portable", options.portable,
               "Leave libsodium as it is before it has looked at the processor");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!options.portable) bench::expect(sodium_init() >= 0, "libsodium does not start");
    bench::measure_packets(options);
    bench::measure_handshakes(options);
    bench::measure_peers(options);
  } catch (const std::exception& e) {
    fmt::print(stderr, "secure_bench: {}\n", e.what());
    return 1;
  }
  return 0;
}
