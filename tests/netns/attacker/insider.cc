#include "tests/netns/attacker/insider.h"

#include <poll.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>

#include "core/wire/bytes.h"
#include "core/wire/round_header.h"
#include "tests/netns/attacker/jpeg.h"

namespace interneuron::attacker {
namespace {

// The longest deadline and lifetime that the wire can say: 71.6 minutes.
constexpr std::uint32_t kForever = std::numeric_limits<std::uint32_t>::max();
// A deadline that no limit of a roadside unit will call too long.
constexpr std::uint32_t kTwoSeconds = 2'000'000;
// Before this it must be admitted.
constexpr double kJoinSeconds = 5;
// The size of a 4K camera, the largest that the images' format allows, and that of a common one.
constexpr std::uint16_t kWide = 3840;
constexpr std::uint16_t kHigh = 2160;
constexpr std::uint16_t kHdWide = 1920;
constexpr std::uint16_t kHdHigh = 1080;

// One attack that goes on.
struct State {
  AdmittedPeer& peer;
  std::mt19937_64& random;
  std::uint32_t victim = 0;
  TimePoint now{};
  // Since the attack began.
  double seconds = 0;
  // How often it has done what it does, and the next round of its own.
  std::uint64_t done = 0;
  std::uint32_t round = 0;

  // Whether the next one of so many per second is due; then it counts as done.
  bool due(double per_second) {
    if (static_cast<double>(done) >= seconds * per_second) return false;
    ++done;
    return true;
  }
};

struct Input {
  std::uint32_t origin = 0;
  std::uint32_t round = 0;
  std::uint32_t deadline_us = kTwoSeconds;
  GuardKind guard = GuardKind::kBudget;
  std::int16_t x_permille = 0;
  RoundState before = RoundState::kOnTime;
};

// The first message of an offloaded round.
Bytes round_message(const State& s, const Input& input, ByteView payload) {
  wire::RoundHeader header;
  header.round = {{input.origin}, PipelineId{0}, {input.round}};
  header.stages = 3;
  header.communication = 0b101;
  header.needs = {255, 0, 0, 0};
  header.policy = wire::policy_id("down_sampling");
  header.t0 = PeerTime{s.now.time_since_epoch()};
  header.deadline_us = input.deadline_us;
  header.period_us = 100'000;
  header.guard = input.guard;
  header.x_permille = input.x_permille;
  header.indicator.fill(input.before);
  header.miss_price = 1000;
  Bytes out(wire::kRoundHeaderBytes + payload.size());
  wire::write_round_header(
      std::span<std::byte, wire::kRoundHeaderBytes>(out.data(), wire::kRoundHeaderBytes), header);
  std::ranges::copy(payload, out.begin() + wire::kRoundHeaderBytes);
  return out;
}

// What the program `vehicle` puts before an image, with all the time in the world for the
// computation (src/app/offload/offload_request.h), and the header of a JPEG image
// (src/app/perception/codec.h).
Bytes request(std::uint16_t width, std::uint16_t height, std::uint32_t frame, ByteView jpeg) {
  constexpr std::size_t kHeads = 24;
  constexpr std::uint8_t kJpeg = 3;
  Bytes out(kHeads + jpeg.size());
  wire::Writer w(out);
  w.put(std::uint16_t{0x4F46});
  w.put(std::uint8_t{1});
  w.put(std::uint8_t{0});
  w.put(kForever);
  w.put(std::uint16_t{0x494D});
  w.put(std::uint8_t{1});
  w.put(kJpeg);
  w.put(width);
  w.put(height);
  w.put(frame);
  w.put(width);
  w.put(height);
  w.put_bytes(jpeg);
  return out;
}

void send_image(State& s, std::uint16_t width, std::uint16_t height, ByteView jpeg, Input input) {
  if (input.origin == 0) input.origin = s.peer.session().value;
  input.round = s.round++;
  const Bytes payload = request(width, height, input.round, jpeg);
  s.peer.send_message(round_message(s, input, payload), input.deadline_us);
}

// --- the attacks

void progressive_bomb(State& s) {
  static const Bytes kBomb = bomb_jpeg(kWide, kHigh, 56'000);
  send_image(s, kWide, kHigh, kBomb, {});
}

// As many as the rate carries, in two sizes, in case one is too large to be taken; every other one
// is wanted for ever.
void job_flood(State& s) {
  static const Bytes kLarge = flat_jpeg(kWide, kHigh);
  static const Bytes kMedium = flat_jpeg(kHdWide, kHdHigh);
  const bool large = s.done % 4 == 3;
  const std::uint32_t deadline = s.done++ % 2 == 0 ? kForever : kTwoSeconds;
  if (large) return send_image(s, kWide, kHigh, kLarge, {.deadline_us = deadline});
  send_image(s, kHdWide, kHdHigh, kMedium, {.deadline_us = deadline});
}

// 316 bytes each, with the header of their round.
void tiny_images(State& s) {
  static const Bytes kTiny = flat_jpeg(8, 8, 316 - wire::kRoundHeaderBytes - 24);
  if (s.due(20)) send_image(s, 8, 8, kTiny, {});
}

// Messages that keep a place for ever, under an origin that sorts behind all others and under our
// own; after 1,100 of each, at the pace of the rounds of two vehicles.
void contexts(State& s) {
  constexpr std::uint64_t kFirst = 2'200;
  if (s.done >= kFirst && static_cast<double>(s.done - kFirst) >= s.seconds * 20) return;
  const std::uint32_t origin = s.done++ % 2 == 0 ? UINT32_MAX : s.peer.session().value;
  const Bytes nothing(8);
  const Bytes message =
      round_message(s, {.origin = origin, .round = s.round++, .deadline_us = kForever}, nothing);
  s.peer.send_message(message, kForever);
}

// The victim's rounds to come, first a window of them far ahead and then all over.
void foreign_origin(State& s) {
  constexpr std::uint64_t kFirst = 64;
  if (s.done >= kFirst && !s.due(20)) return;
  if (s.done < kFirst) ++s.done;
  const auto round = s.done <= kFirst ? static_cast<std::uint32_t>(1'000'000 + s.done)
                                      : static_cast<std::uint32_t>(s.random() >> 33);
  static const Bytes kTiny = flat_jpeg(8, 8);
  const Bytes payload = request(8, 8, round, kTiny);
  const std::uint32_t deadline = s.done % 2 == 0 ? kForever : kTwoSeconds;
  s.peer.send_message(
      round_message(s, {.origin = s.victim, .round = round, .deadline_us = deadline}, payload),
      deadline);
}

// The last piece, of one byte, of messages as large as they may be; some at a time, since each has
// few bytes.
void big_claims(State& s) {
  constexpr std::uint16_t kPieces = 6'227;
  constexpr auto kChunk = static_cast<std::uint16_t>(kMaxPieceBytes);
  constexpr int kAtOnce = 8;
  const Bytes piece(1);
  for (int i = 0; i < kAtOnce; ++i) {
    s.peer.send_piece(std::uint32_t{kChunk} * kPieces + 1, kChunk, kPieces, piece, kForever);
  }
}

// Rounds that say that all was missed and that everything may be late, by the paper's guard.
void indicator(State& s) {
  static const Bytes kTiny = flat_jpeg(64, 64);
  if (!s.due(10)) return;
  send_image(s, 64, 64, kTiny,
             {.guard = GuardKind::kPaper,
              .x_permille = std::numeric_limits<std::int16_t>::max(),
              .before = RoundState::kMissed});
}

// Numbers at the end of what a packet can have, in no order, between rounds as an honest peer's.
void last_numbers(State& s) {
  if (s.due(100)) {
    Bytes packet(wire::kPacketOverhead);
    auto header = s.peer.header(wire::PacketType::kProbe, s.now);
    header.number = std::numeric_limits<std::uint64_t>::max() - s.random() % 300;
    wire::write_probe(packet, header, packet.size());
    s.peer.send_packet(std::move(packet), true);
  }
}

void unknown_types(State& s) {
  // Those that admission does not use, and that for keys.
  constexpr std::array<std::uint8_t, 9> kTypes{5, 9, 10, 11, 12, 13, 14, 15, 0};
  Bytes packet(wire::kPacketOverhead + s.random() % 400);
  wire::write_probe(packet, s.peer.header(wire::PacketType::kProbe, s.now), packet.size());
  packet[0] = static_cast<std::byte>(wire::kVersion << 4 | kTypes[s.random() % kTypes.size()]);
  s.peer.send_packet(std::move(packet));
}

struct Attack {
  const char* name;
  void (*step)(State&);
};

constexpr std::array<Attack, 9> kAttacks{{{"progressive_bomb", progressive_bomb},
                                          {"job_flood", job_flood},
                                          {"tiny_images", tiny_images},
                                          {"contexts", contexts},
                                          {"foreign_origin", foreign_origin},
                                          {"big_claims", big_claims},
                                          {"indicator", indicator},
                                          {"last_numbers", last_numbers},
                                          {"unknown_types", unknown_types}}};

const Attack& attack_of(const std::string& name) {
  for (const Attack& attack : kAttacks) {
    if (name == attack.name) return attack;
  }
  throw std::runtime_error("--attack '" + name + "': there is no such attack");
}

void tell(const InsiderOptions& o, const AdmittedPeer& peer, double joined, double took) {
  const AdmittedPeer::Counters& c = peer.counters();
  std::printf(
      "{\"attack\": \"%s\", \"joined\": %s, \"join_s\": %.3f, \"seconds\": %.3f, \"sent_packets\": "
      "%llu, \"sent_bytes\": %llu, \"received_packets\": %llu, \"challenges\": %llu, \"results\": "
      "%llu}\n",
      o.attack.c_str(), peer.joined() ? "true" : "false", joined, took,
      static_cast<unsigned long long>(c.sent_packets),
      static_cast<unsigned long long>(c.sent_bytes),
      static_cast<unsigned long long>(c.received_packets),
      static_cast<unsigned long long>(c.challenges), static_cast<unsigned long long>(c.results));
}

}  // namespace

std::vector<std::string> insider_attacks() {
  std::vector<std::string> names;
  for (const Attack& attack : kAttacks) names.emplace_back(attack.name);
  return names;
}

int run_insider(const InsiderOptions& o) {
  require_confined(o.nic);
  const Attack& attack = attack_of(o.attack);
  const io::FileDescriptor socket = open_udp(o.nic, {}, &o.road);
  std::mt19937_64 random(o.seed);
  const TimePoint began = now();
  std::optional<Keys> keys;
  if (!o.key.empty()) keys = {read_key(o.key), read_public_key(o.road_key)};
  AdmittedPeer peer(socket.get(), 1000 * o.kbit, began, random, keys ? &*keys : nullptr);
  State state{.peer = peer, .random = random, .victim = o.victim_session};
  std::optional<TimePoint> joined;
  while (!joined || seconds_between(*joined, now()) < o.seconds) {
    pollfd item{socket.get(), POLLIN, 0};
    ::poll(&item, 1, 1);
    state.now = now();
    peer.turn(state.now);
    if (!joined && peer.joined()) joined = state.now;
    if (!joined && seconds_between(began, state.now) > kJoinSeconds) break;
    if (!joined || !peer.idle()) continue;
    state.seconds = seconds_between(*joined, state.now);
    attack.step(state);
  }
  tell(o, peer, seconds_between(began, joined.value_or(now())),
       joined ? seconds_between(*joined, now()) : 0);
  return joined ? 0 : 1;
}

}  // namespace interneuron::attacker
