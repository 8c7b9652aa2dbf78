// The policy `progressive` through rounds of seven stages: a sampled picture over the quick link,
// detection, request for the regions in doubt, cut out, regions over the other link, detection,
// result.
#include <array>
#include <cstdio>
#include <random>

#include "lab/sim/world.h"
#include "support.h"

namespace interneuron::sim::progressive_test {
namespace {

constexpr LinkId kQuick{0};
constexpr LinkId kOther{1};
constexpr Duration kPeriod = 100ms;
constexpr Duration kSlot = 50ms;  // delays change from one to the next

// What an answer was made from.
enum class From : std::uint8_t { kNothing, kBackup, kSampled, kRegions };

struct Round {
  int answers = 0;
  RoundDone done;
  From from = From::kNothing;
  std::optional<Duration> sampled_back;  // the first result was at the vehicle, after t0
  Plan first;
  std::optional<Plan> regions;
};

// A vehicle and a roadside of two cores, one for each detection.
class Offloading {
 public:
  Offloading(std::uint64_t seed, bool asks_for_regions, Duration deadline, int rounds,
             bool disturbed)
      : world_(seed), asks_(asks_for_regions), rounds_(static_cast<std::size_t>(rounds)) {
    constexpr auto kComm = StageKind::kCommunication;
    constexpr auto kComp = StageKind::kComputation;
    PipelineConfig pipeline;
    pipeline.stages =
        asks_ ? std::vector{kComm, kComp, kComm, kComp, kComm, kComp, kComm} : offload_stages();
    pipeline.deadline = deadline;
    pipeline.policy = "progressive";
    EndpointOptions o{
        .session = SessionId{1}, .pipelines = {pipeline}, .policies = builtin_policies()};
    vehicle_ = world_.add_host(o);
    o.session = SessionId{2};
    o.pipelines.clear();
    o.accept_peers = true;
    road_ = world_.add_host(o);
    const std::array profiles{constant_link("quick", 22, 100, 100),
                              constant_link("other", 45, 30, 30)};
    for (const LinkId link : {kQuick, kOther}) {
      const emu::LinkProfile& p = profiles.at(link.value);
      // The operator's word, so that the first link does not depend on what was measured.
      world_.add_link(vehicle_, road_, link, p.name, emu::Link(p, emu::link_seed(seed, link.value)),
                      {.priority = link.value});
    }
    if (disturbed) disturb(seed);
    world_.on_event([this](HostId host, Event&& event) { handle(host, event); });
    peer_ = world_.connect(vehicle_, road_);
    for (std::size_t i = 0; i < rounds_.size(); ++i) {
      world_.at(kWarmUp + static_cast<int>(i) * kPeriod, [this] { begin(); });
    }
    world_.run_until(kWarmUp + rounds * kPeriod + 1s);
  }
  const std::vector<Round>& rounds() const { return rounds_; }

 private:
  // U(15, 80) ms more in bursts of 4 slots on average, one slot in twenty, per link and direction.
  void disturb(std::uint64_t seed) {
    std::mt19937_64 rng(seed);
    const auto count = static_cast<std::size_t>((kWarmUp + 1s) / kSlot) + rounds_.size() * 2;
    for (auto& slots : extra_) {
      bool bad = false;
      while (slots.size() < count) {
        bad = std::bernoulli_distribution(bad ? 0.75 : 0.0132)(rng);
        const auto us = std::uniform_int_distribution<int>(15'000, 80'000)(rng);
        slots.push_back(bad ? Duration(std::chrono::microseconds(us)) : Duration{});
      }
    }
    world_.delay_with([this](HostId from, const LeavingPacket& packet) {
      const auto& slots = extra_.at(packet.link.value * 2U + (from == vehicle_ ? 0U : 1U));
      const auto slot = static_cast<std::size_t>(world_.now() / kSlot);
      return world_.now() < kWarmUp || slot >= slots.size() ? Duration{} : slots[slot];
    });
  }

  void begin() {
    Endpoint& endpoint = world_.endpoint(vehicle_);
    const RoundRef ref = endpoint.begin_round(now(vehicle_), PipelineId{0});
    endpoint.submit(now(vehicle_), ref, {Bytes(512 * 1024), Bytes(128 * 1024)}, MessageClass::kData,
                    peer_);
    world_.flush(vehicle_);
    later(9ms, vehicle_, [this, ref] { keep(ref, From::kBackup); });
  }
  void keep(const RoundRef& ref, From from) {
    world_.endpoint(vehicle_).local_result(now(vehicle_), ref, Bytes(3000, std::byte(from)));
  }

  void handle(HostId host, Event& event) {
    if (auto* done = std::get_if<RoundDone>(&event)) {
      Round& round = rounds_.at(done->round.round.value);
      ++round.answers;
      if (!done->result.empty() && done->age_rounds == 0U) round.from = From(done->result[0]);
      round.done = *done;
      if (!asks_ && done->outcome == Outcome::kRemote) round.sampled_back = done->e2e;
    } else if (auto* planned = std::get_if<Planned>(&event);
               planned != nullptr && host == vehicle_) {
      Round& round = rounds_.at(planned->round.round.value);
      if (planned->stage == 1) round.first = planned->plan;
      if (planned->stage == 5) round.regions = planned->plan;
    } else if (auto* delivered = std::get_if<Delivered>(&event)) {
      next_stage(host, *delivered);
    }
  }

  void next_stage(HostId host, const Delivered& delivered) {
    const RoundRef ref = delivered.round;
    if (delivered.stage == 3) {  // the first result, and what is in doubt
      rounds_.at(ref.round.value).sampled_back =
          world_.now() - kWarmUp - static_cast<int>(ref.round.value) * kPeriod;
      keep(ref, From::kSampled);
      later(1ms, host, [this, ref] {
        world_.endpoint(vehicle_).submit(now(vehicle_), ref, {Bytes(60 * 1024), Bytes(20 * 1024)},
                                         MessageClass::kData);
      });
      return;
    }
    const bool first = delivered.stage == 1;
    later(first ? 19ms : 8ms, host, [this, ref, first] {
      world_.endpoint(road_).submit(
          now(road_), ref, {Bytes(3000, std::byte(first ? From::kSampled : From::kRegions))},
          MessageClass::kResult);
    });
  }

  TimePoint now(HostId host) { return world_.local_time(host); }
  void later(Duration in, HostId host, std::function<void()> action) {
    world_.at(world_.now() + in, [this, host, action = std::move(action)] {
      action();
      world_.flush(host);
    });
  }

  World world_;
  bool asks_;
  std::vector<Round> rounds_;
  std::array<std::vector<Duration>, 4> extra_;  // by link and direction
  HostId vehicle_ = 0;
  HostId road_ = 0;
  PeerId peer_{};
};

TEST(Progressive, RegionsOverTheOtherLinkMakeABetterAnswerInTime) {
  const Offloading o(1, true, 130ms, 50, false);
  for (const Round& r : o.rounds()) {
    EXPECT_EQ(r.answers, 1);
    EXPECT_EQ(r.done.outcome, Outcome::kRemote);
    EXPECT_EQ(r.from, From::kRegions);
    ASSERT_EQ(r.first.sends.size(), 1U);
    EXPECT_EQ(r.first.sends[0], (Assignment{1, kQuick}));
    ASSERT_TRUE(r.regions);
    ASSERT_EQ(r.regions->sends.size(), 1U);
    EXPECT_EQ(r.regions->sends[0].link, kOther);
  }
}

TEST(Progressive, WithoutRoomTheFirstResultIsTheAnswerAtOnce) {
  const Offloading o(1, true, 85ms, 50, false);
  for (const Round& r : o.rounds()) {
    EXPECT_EQ(r.answers, 1);
    EXPECT_EQ(r.from, From::kSampled);
    ASSERT_TRUE(r.regions);
    EXPECT_EQ(r.regions->refused, kNoTimeLeft);
    EXPECT_EQ(r.done.e2e, *r.sampled_back + 1ms);  // cut out, and refused
  }
}

// Against the same delays without requests.
TEST(Progressive, NeverCostsARoundItsFirstResult) {
  int regions = 0;
  int sampled = 0;
  int plain_on_time = 0;
  for (std::uint64_t seed = 1; seed <= (kSanitized ? 2 : 8); ++seed) {
    const Offloading with(seed, true, 130ms, 100, true);
    const Offloading plain(seed, false, 130ms, 100, true);
    for (std::size_t i = 0; i < with.rounds().size(); ++i) {
      const Round& r = with.rounds()[i];
      ASSERT_EQ(r.answers, 1) << "seed " << seed << " round " << i;
      ASSERT_LE(r.done.e2e, 130ms);
      regions += r.from == From::kRegions ? 1 : 0;
      sampled += r.from == From::kSampled ? 1 : 0;
      if (r.sampled_back && *r.sampled_back < 130ms) {
        EXPECT_GE(r.from, From::kSampled) << "seed " << seed << " round " << i;
      }
      if (plain.rounds()[i].done.outcome != Outcome::kRemote) continue;
      ++plain_on_time;
      EXPECT_GE(r.from, From::kSampled)
          << "seed " << seed << " round " << i << ": without requests it took "
          << static_cast<double>(plain.rounds()[i].done.e2e.count()) / 1e6 << " ms";
    }
  }
  std::printf("answers from regions %d, from the sampled picture %d; without requests %d on time\n",
              regions, sampled, plain_on_time);
  EXPECT_GT(regions, 0);
  EXPECT_GT(sampled, 0);
}

}  // namespace
}  // namespace interneuron::sim::progressive_test
