// Ten million packets that somebody else has made, changed or repeated, to both sides of a
// connection that goes on: nothing of it is used, nothing is answered, and all of it is counted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <random>
#include <set>

#include "core/secure/handshake.h"
#include "encrypted.h"

namespace interneuron::forgery_test {
namespace {

// The attacker's own address; nothing may go there.
constexpr std::size_t kAttacker = 66;
// Rounds, 100 ms each: over two renewals of the keys.
constexpr int kRounds = 2600;
constexpr std::uint64_t kSeed = 20260721;
constexpr std::size_t kRecorded = 4096;
// Above the delays of the pipe's links.
constexpr Duration kLongestWay = 20ms;

enum Kind {
  kNoise,
  kGuessedSession,
  kChangedBit,
  kChangedHeader,
  kTruncated,
  kReplayed,
  kReplayedOnOtherLink,
  kReplayedFromElsewhere,
  kOldEpoch,
  kLargestNumber,
  kClear,
  kHandshake,
  kChangedHandshake,
  kKinds
};

struct Attacker {
  Encrypted e;
  std::mt19937_64 random{kSeed};
  std::size_t to_attacker = 0;
  std::array<std::array<std::uint64_t, 2>, 2> honest{};
  std::array<std::array<std::uint64_t, 2>, 2> injected{};
  // What each host has sent lately, in its first minute, and of handshakes.
  std::array<std::vector<Pipe::Captured>, 2> lately;
  std::array<std::vector<Pipe::Captured>, 2> at_first;
  std::vector<Pipe::Captured> handshakes;
  std::deque<std::pair<Duration, Pipe::Captured>> under_way;

  Attacker() {
    e.pipe.capture = nullptr;
    for (const Pipe::Captured& c : e.captured) note(c);
    e.pipe.on_transmit = [this](std::size_t from, std::size_t to, LinkId link, const Bytes& bytes) {
      to_attacker += to == kAttacker ? 1 : 0;
      under_way.push_back({e.pipe.now(), {from, link, bytes}});
    };
  }
  void note(const Pipe::Captured& c) {
    const auto header = wire::peek(c.bytes);
    if (header && wire::is_handshake(header->type)) handshakes.push_back(c);
    if (at_first[c.from].size() < kRecorded) at_first[c.from].push_back(c);
    auto& ring = lately[c.from];
    if (ring.size() < kRecorded) {
      ring.push_back(c);
    } else {
      ring[below(kRecorded)] = c;
    }
  }
  std::size_t below(std::size_t n) { return random() % n; }
  void scribble(Bytes& bytes, std::size_t from) {
    for (std::size_t i = from; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(random());
  }
  // What has arrived may be repeated: who is faster than the path itself is answered once, by a
  // challenge or a response, since nobody can tell him from a peer that has moved.
  void record() {
    while (!under_way.empty() && under_way.front().first + kLongestWay < e.pipe.now()) {
      note(under_way.front().second);
      under_way.pop_front();
    }
  }
  // One packet to this host, as if from there.
  void inject(std::size_t host, LinkId link, std::size_t from, const Bytes& bytes) {
    ++injected[host][link.value];
    e.pipe.at(host).handle_datagram(e.pipe.local(host), {link, address_of(from), bytes});
    if (injected[host][link.value] % 64 == 0) e.pipe.flush(host);
  }
  // Feedback to this host as the other side would write it where nothing is encrypted, or a
  // stranger.
  Bytes feedback_in_the_clear(std::size_t host, LinkId link) {
    wire::Feedback feedback;
    feedback.echo = SessionId{host == e.road ? 22U : 11U};
    Bytes bytes(kMaxDatagramBytes);
    const SessionId session{1 + static_cast<std::uint32_t>(below(30))};
    const wire::PacketHeader header{wire::PacketType::kFeedback, link, wire::kClearEpoch, session,
                                    1 + random() / 2};
    bytes.resize(wire::write_feedback(bytes, header, feedback));
    return bytes;
  }
  // Flips a bit of a handshake. Returns whether its first MAC is then made right, which whoever
  // knows the road's public key can do.
  bool change_handshake(Bytes& bytes) {
    bytes[below(bytes.size())] ^= std::byte{1} << below(8);
    if (bytes.size() != crypto::kInitiationBytes || below(2) == 0) return false;
    const auto parts = crypto::parts_of_initiation(bytes);
    std::ranges::copy(
        crypto::mac_of(crypto::mac1_key(sim::key_of_host(kRoadKey)), parts.before_mac1),
        bytes.begin() + (parts.mac1.data() - bytes.data()));
    return true;
  }
  void attack(std::size_t host, Kind kind) {
    const std::size_t other = 1 - host;
    const auto& recorded = kind == kOldEpoch ? at_first[other] : lately[other];
    const Pipe::Captured& seen = recorded[below(recorded.size())];
    Bytes bytes = seen.bytes;
    LinkId link = seen.link;
    std::size_t from = below(2) == 0 ? other : kAttacker;
    switch (kind) {
      case kNoise:
        bytes.resize(below(kMaxDatagramBytes));
        scribble(bytes, 0);
        break;
      case kGuessedSession:
        scribble(bytes, 4);
        break;
      case kChangedBit: {
        const std::size_t bit = below(8 * bytes.size());
        bytes[bit / 8] ^= std::byte{1} << bit % 8;
        break;
      }
      case kChangedHeader:
        bytes[below(wire::kHeaderBytes)] = static_cast<std::byte>(random());
        break;
      case kTruncated:
        bytes.resize(below(bytes.size()));
        break;
      case kReplayed:
        from = other;
        break;
      case kReplayedOnOtherLink:
        link = LinkId{static_cast<std::uint16_t>(1 - link.value)};
        break;
      case kReplayedFromElsewhere:
      case kOldEpoch:
        from = kAttacker;
        break;
      case kLargestNumber:
        std::fill_n(bytes.begin() + 8, 8, std::byte{0xff});
        break;
      case kClear:
        bytes = feedback_in_the_clear(host, link);
        break;
      case kHandshake:
      case kChangedHandshake:
        bytes = handshakes[below(handshakes.size())].bytes;
        link = LinkId{static_cast<std::uint16_t>(below(2))};
        if (kind == kChangedHandshake && change_handshake(bytes)) from = other;
        break;
      case kKinds:
        break;
    }
    inject(host, link, from, bytes);
  }
};

std::uint64_t all_received(const LinkCounters& c) {
  return c.received_packets + c.duplicate_packets + c.malformed_packets + c.other_version_packets +
         c.other_packets + c.refused_packets + c.unauthentic_packets + c.handshake_packets;
}

// The ten million of a run of acceptance, or a tenth of it.
std::size_t packets() {
  const char* const given = std::getenv("INTERNEURON_FORGED_PACKETS");
  return given == nullptr ? 1'000'000 : std::stoull(given);
}

TEST(Forgery, NothingOfItIsUsedAndNothingIsAnswered) {
  Encrypted quiet;
  quiet.rounds(kRounds);
  Attacker a;
  const std::size_t each = packets() / kRounds;
  std::array<std::uint64_t, kKinds> kinds{};
  for (int round = 0; round < kRounds; ++round) {
    a.e.pipe.round(a.e.vehicle, PipelineId{0}, {Bytes(20'000), Bytes(5'000)});
    for (int slice = 0; slice < 10; ++slice) {
      for (std::size_t i = 0; i < each / 10; ++i) {
        const auto kind = static_cast<Kind>(a.below(kKinds));
        ++kinds[kind];
        a.attack(a.below(2), kind);
      }
      a.e.pipe.flush(a.e.vehicle);
      a.e.pipe.flush(a.e.road);
      a.record();
      a.e.pipe.run(10ms);
    }
  }
  EXPECT_EQ(a.to_attacker, 0U);
  EXPECT_EQ(quiet.remote(), kRounds);
  EXPECT_EQ(a.e.remote(), kRounds);
  EXPECT_EQ(a.e.delivered.size(), quiet.delivered.size());
  EXPECT_EQ(a.e.restarted, 0);
  EXPECT_EQ(a.e.lost, 0);
  EXPECT_EQ(a.e.ready.size(), 2U);
  std::uint64_t total = 0;
  std::uint64_t unused = 0;
  for (const std::size_t host : {a.e.vehicle, a.e.road}) {
    EXPECT_EQ(a.e.pipe.at(host).peers().size(), 1U);
    const auto links = a.e.pipe.at(host).links(a.e.pipe.local(host), a.e.pipe.at(host).peers()[0]);
    EXPECT_EQ(links.size(), 2U);
    for (const LinkState& link : links) EXPECT_EQ(link.path, PathState::kOk);
    for (const LinkId link : {kFast, kSlow}) {
      const LinkCounters c = a.e.pipe.at(host).link_counters(link);
      total += a.injected[host][link.value];
      unused += all_received(c) - c.received_packets;
    }
  }
  std::printf("%llu packets, %llu counted as not used\n", static_cast<unsigned long long>(total),
              static_cast<unsigned long long>(unused));
  EXPECT_GE(unused, total);
  // The handshakes of both sides, and what came over a path before it was proved.
  EXPECT_LE(unused, total + 100);
}

// Two of the paths go and come back at one instant, ten thousand times: one under its name, one
// under another.
void change_paths(Pipe& pipe, std::size_t vehicle, std::size_t road, PeerId peer) {
  for (int i = 0; i < 10'000; ++i) {
    const LinkId same{0};
    pipe.at(vehicle).remove_link(pipe.local(vehicle), same);
    pipe.at(vehicle).add_link(pipe.local(vehicle), same, {"nic", 1500});
    EXPECT_TRUE(pipe.at(vehicle).add_path(pipe.local(vehicle), peer, same, address_of(road)));
    const LinkId before{static_cast<std::uint16_t>(i == 0 ? 1 : 7 + i)};
    const LinkId after{static_cast<std::uint16_t>(8 + i)};
    pipe.delay[after] = 5ms;
    pipe.at(vehicle).remove_link(pipe.local(vehicle), before);
    pipe.at(vehicle).add_link(pipe.local(vehicle), after, {"nic", 1500});
    EXPECT_TRUE(pipe.at(vehicle).add_path(pipe.local(vehicle), peer, after, address_of(road)));
    if (i % 100 == 0) pipe.at(road).add_link(pipe.local(road), after, {"nic", 1500});
    pipe.flush(vehicle);
  }
  pipe.at(road).add_link(pipe.local(road), LinkId{10'007}, {"nic", 1500});
}

// Both get eight links; returns the addresses of the road over them.
std::vector<std::pair<LinkId, Address>> eight_links(Pipe& pipe, std::size_t vehicle,
                                                    std::size_t road) {
  std::vector<std::pair<LinkId, Address>> addresses;
  for (std::uint16_t i = 0; i < 8; ++i) {
    const LinkId link{i};
    pipe.delay[link] = 5ms + i * 1ms;
    for (const std::size_t host : {vehicle, road}) {
      pipe.at(host).add_link(pipe.local(host), link, {"nic", 1500});
    }
    addresses.emplace_back(link, address_of(road));
  }
  return addresses;
}

// No number twice under one key: over 8 paths, across renewals, and however often paths are taken
// away and come back at one instant, under the same name or another one.
TEST(Forgery, NoNumberIsSealedTwice) {
  Pipe pipe;
  const std::size_t vehicle = pipe.add_host(Encrypted::vehicle_options());
  const std::size_t road = pipe.add_host(Encrypted::road_options({kVehicleKey}));
  const auto addresses = eight_links(pipe, vehicle, road);
  int done = 0;
  int remote = 0;
  std::size_t sealed = 0;
  std::size_t twice = 0;
  std::map<std::uint16_t, std::size_t> on_link;
  std::set<std::tuple<std::uint32_t, bool, std::uint16_t, std::uint64_t>> seen;
  pipe.on_event = [&](std::size_t host, Event& event) {
    if (auto* d = std::get_if<Delivered>(&event); d != nullptr && host == road) {
      pipe.submit(road, d->round, 100);
    } else if (auto* r = std::get_if<RoundDone>(&event)) {
      ++done;
      remote += r->outcome == Outcome::kRemote ? 1 : 0;
    }
  };
  pipe.on_transmit = [&](std::size_t, std::size_t, LinkId, const Bytes& bytes) {
    const auto header = wire::peek(bytes);
    if (!header || header->epoch == wire::kClearEpoch) return;
    ++sealed;
    ++on_link[header->link.value];
    twice += seen.emplace(header->session.value, wire::is_numbered(header->type),
                          header->link.value, header->number)
                     .second
                 ? 0
                 : 1;
  };
  const PeerId peer = pipe.at(vehicle).connect(pipe.local(vehicle), addresses);
  pipe.flush(vehicle);
  pipe.run(1s);
  for (int i = 0; i < 3000; ++i) {
    pipe.round(vehicle, PipelineId{0}, {Bytes(70'000)});
    pipe.run(100ms);
  }
  EXPECT_GE(sealed, 300'000U);
  for (const auto& [link, count] : on_link) EXPECT_GE(count, 20'000U) << link;
  EXPECT_GE(remote, 2990);
  change_paths(pipe, vehicle, road, peer);
  const int before = remote;
  for (int i = 0; i < 200; ++i) {
    pipe.round(vehicle, PipelineId{0}, {Bytes(20'000)});
    pipe.run(100ms);
  }
  EXPECT_EQ(twice, 0U);
  EXPECT_GE(remote - before, 195);
  const auto links = pipe.at(vehicle).links(pipe.local(vehicle), peer);
  ASSERT_EQ(links.size(), 8U);
  for (const LinkState& link : links) EXPECT_EQ(link.path, PathState::kOk) << link.id.value;
  std::printf("%zu packets sealed, %zu of them twice; %d of %d rounds remote\n", sealed, twice,
              remote, done);
}

}  // namespace
}  // namespace interneuron::forgery_test
