#include "core/link/path_machine.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <random>

namespace interneuron::link::path_machine_test {
namespace {

using namespace std::chrono_literals;

TimePoint at(Duration d) { return TimePoint{d}; }

// A path in virtual time: heartbeats from the peer, data at 10 Hz in bursts of 40 packets over 40
// ms, acknowledged a round trip after they were sent, while `works` says so.
class Drive {
 public:
  struct Options {
    Duration rtt = 40ms;
    Duration heartbeat = 50ms;
    bool data = true;
    double loss = 0;
    unsigned seed = 1;
  };
  explicit Drive(const Options& options) : options_(options), random_(options.seed) {
    machine.set_pace(now_, {options.rtt, options.rtt / 20, {}, options.heartbeat});
  }

  void run(Duration until, bool works) {
    for (; now_ < at(until); now_ += 1ms) {
      const auto ms = now_.time_since_epoch() / 1ms;
      wake();
      const bool passes = works && u_(random_) >= options_.loss;
      if (ms % (options_.heartbeat / 1ms) == 0 && passes) hear(now_ + options_.rtt / 2, {});
      if (options_.data && ms % 100 < 40) {
        machine.sent(now_, true);
        // Feedback comes after every eighth packet here, and after the last.
        if (passes && (ms % 8 == 0 || ms % 100 == 39) && machine.usable())
          hear(now_ + options_.rtt, now_);
      }
      deliver();
      note();
    }
  }
  PathMachine machine;
  std::vector<std::pair<TimePoint, PathState>> log;  // when which state began
  std::optional<TimePoint> first(PathState state, TimePoint after) const {
    for (const auto& [when, to] : log) {
      if (when >= after && to == state) return when;
    }
    return std::nullopt;
  }
  TimePoint now() const { return now_; }

 private:
  struct Arrival {
    TimePoint at;
    std::optional<TimePoint> sent_at;
  };
  void hear(TimePoint when, std::optional<TimePoint> sent_at) {
    arrivals_.push_back({when, sent_at});
  }
  void deliver() {
    for (auto it = arrivals_.begin(); it != arrivals_.end();) {
      if (it->at > now_) {
        ++it;
        continue;
      }
      machine.heard(now_);
      if (it->sent_at) machine.delivered(now_, *it->sent_at, true);
      it = arrivals_.erase(it);
    }
  }
  void wake() {
    const auto next = machine.next_timeout();
    if (next && *next <= now_) machine.handle_timeout(now_);
    const auto after = machine.next_timeout();
    EXPECT_TRUE(!after || *after > now_) << "a timeout that is handled must not be due again";
  }
  void note() {
    while (auto change = machine.poll_change()) {
      EXPECT_FALSE(change->reason.empty());
      log.emplace_back(now_, change->to);
    }
  }
  Options options_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> u_;
  TimePoint now_ = at(0s);
  std::vector<Arrival> arrivals_;
};

TEST(PathMachine, WhatIsSentBeforeTheFirstRoundTripIsNotLateYet) {
  PathMachine m;
  m.set_pace(at(0s), {{}, {}, {}, 50ms});
  m.heard(at(1s));
  m.sent(at(1s), true);
  m.heard(at(1100ms));  // heartbeats go on
  m.handle_timeout(at(1124ms));
  EXPECT_EQ(m.state(), PathState::kOk);
  m.heard(at(1150ms));
  m.handle_timeout(at(1199ms));
  EXPECT_EQ(m.state(), PathState::kOk);
  EXPECT_EQ(m.next_timeout(), at(1200ms));
  m.handle_timeout(at(1200ms));
  EXPECT_EQ(m.state(), PathState::kSuspect);
  // As soon as it is known, it counts.
  m.set_pace(at(1210ms), {40ms, 10ms, {}, 50ms});
  m.delivered(at(1210ms), at(1s), true);
  m.sent(at(1220ms), true);
  EXPECT_EQ(m.state(), PathState::kOk);
  m.heard(at(1225ms));
  EXPECT_EQ(m.next_timeout(), at(1280ms));
}

TEST(PathMachine, SilenceWithinTheHeartbeatPromisedBeforeIsNone) {
  PathMachine m;
  m.set_pace(at(0s), {40ms, 10ms, {}, 12s});
  m.heard(at(0s));
  // Messages begin: heartbeats are expected at the active pace from now on.
  m.set_pace(at(11s), {40ms, 10ms, {}, 50ms});
  EXPECT_EQ(m.state(), PathState::kOk);
  EXPECT_GE(m.next_timeout(), at(11s + 100ms));
  m.heard(at(11050ms));
  m.handle_timeout(at(11100ms));
  EXPECT_EQ(m.state(), PathState::kOk);
  // They do not come.
  m.set_pace(at(20s), {40ms, 10ms, {}, 50ms});
  EXPECT_EQ(m.state(), PathState::kDead);
}

// What is withheld because there is no other path must not keep the loop awake.
TEST(PathMachine, NoTimeoutIsLeftBehindByOneThatWasHandled) {
  for (const bool last : {false, true}) {
    for (const Duration rtt : {0ms, 5ms, 40ms, 900ms}) {
      PathMachine m;
      m.set_pace(at(0s), {rtt, rtt / 4, {}, 50ms});
      m.set_last_usable(last);
      m.heard(at(0s));
      for (int i = 0; i < 20; ++i) m.sent(at(i * 1ms), true);
      int wakes = 0;
      for (auto due = m.next_timeout(); due; due = m.next_timeout()) {
        ASSERT_LT(++wakes, 10);
        m.handle_timeout(*due);
        const auto next = m.next_timeout();
        ASSERT_TRUE(!next || *next > *due) << to_ms(due->time_since_epoch());
      }
      EXPECT_EQ(m.state(), PathState::kDead);
    }
  }
}

TEST(PathMachine, IsDeadUntilItIsHeard) {
  PathMachine m;
  EXPECT_EQ(m.state(), PathState::kDead);
  EXPECT_FALSE(m.usable());
  EXPECT_EQ(m.outage(at(5s)), 0);
  EXPECT_FALSE(m.next_timeout());
  m.handle_timeout(at(1s));
  EXPECT_FALSE(m.poll_change());
  m.heard(at(2s));
  EXPECT_EQ(m.state(), PathState::kOk);
  EXPECT_EQ(m.share(at(2s)), 1.0) << "nothing bad is known of it";
  const auto change = m.poll_change();
  ASSERT_TRUE(change);
  EXPECT_EQ(change->from, PathState::kDead);
  EXPECT_EQ(change->to, PathState::kOk);
}

TEST(PathMachine, ASilentOutageUnderLoadIsNoticedWithin100Ms) {
  for (const Duration rtt : {2ms, 10ms, 30ms, 50ms}) {
    for (int phase = 0; phase < 40; phase += 3) {  // while data leaves
      Drive drive({.rtt = rtt});
      const Duration from = 5s + phase * 1ms;
      drive.run(from, true);
      ASSERT_EQ(drive.machine.state(), PathState::kOk) << to_ms(rtt);
      drive.run(from + 400ms, false);
      const auto suspect = drive.first(PathState::kSuspect, at(from));
      const auto pulled = drive.first(PathState::kPulled, at(from));
      ASSERT_TRUE(suspect || pulled) << to_ms(rtt);
      const TimePoint noticed =
          std::min(suspect.value_or(TimePoint::max()), pulled.value_or(TimePoint::max()));
      EXPECT_LE(to_ms(noticed - at(from)), 100) << to_ms(rtt) << " phase " << phase;
      EXPECT_EQ(drive.machine.state(), PathState::kPulled);
    }
  }
}

TEST(PathMachine, ASilentIdlePathIsNoticedWithinThreeHeartbeats) {
  for (const Duration heartbeat : {50ms, 300ms, 12'000ms}) {
    Drive drive({.rtt = 30ms, .heartbeat = heartbeat, .data = false});
    const Duration from = 10 * heartbeat;
    drive.run(from, true);
    ASSERT_EQ(drive.machine.state(), PathState::kOk);
    drive.run(from + 4 * heartbeat, false);
    const auto suspect = drive.first(PathState::kSuspect, at(from));
    ASSERT_TRUE(suspect);
    EXPECT_LE(*suspect - at(from), 3 * heartbeat);
  }
}

TEST(PathMachine, TheFirstInboundByteBringsAPulledPathBack) {
  Drive drive({.rtt = 40ms});
  drive.run(5s, true);
  drive.run(5900ms, false);
  ASSERT_EQ(drive.machine.state(), PathState::kPulled);
  EXPECT_EQ(drive.machine.share(at(5900ms)), 0.0);
  drive.machine.heard(at(5900ms));
  EXPECT_EQ(drive.machine.state(), PathState::kOk);
  EXPECT_EQ(drive.machine.share(at(5900ms)), 1.0) << "it was not given up";
}

// The peer's feedback may come over another path.
TEST(PathMachine, AnAcknowledgementOfWhatWasSentWhilePulledIsASignOfLifeToo) {
  Drive drive({.rtt = 40ms});
  drive.run(5s, true);
  drive.run(5500ms, false);
  ASSERT_EQ(drive.machine.state(), PathState::kPulled);
  drive.machine.delivered(at(5500ms), at(4999ms), true);
  EXPECT_EQ(drive.machine.state(), PathState::kPulled) << "sent before";
  drive.machine.delivered(at(5520ms), at(5450ms), false);
  EXPECT_EQ(drive.machine.state(), PathState::kOk);
}

TEST(PathMachine, SilenceForSecondsIsDeathAndTheReturnRamps) {
  Drive drive({.rtt = 40ms});
  drive.run(5s, true);
  drive.run(8s, false);
  EXPECT_EQ(drive.machine.state(), PathState::kPulled);
  drive.run(10s, false);
  EXPECT_EQ(drive.machine.state(), PathState::kDead);
  drive.run(20s, false);
  drive.machine.heard(at(20s));
  EXPECT_EQ(drive.machine.state(), PathState::kOk);
  EXPECT_NEAR(drive.machine.share(at(20s)), 0.1, 1e-9);
  EXPECT_NEAR(drive.machine.share(at(20500ms)), 0.55, 1e-9);
  EXPECT_NEAR(drive.machine.share(at(21s)), 1.0, 1e-9);
}

TEST(PathMachine, RemovalIsDeathAtOnce) {
  Drive drive({.rtt = 40ms});
  drive.run(1s, true);
  drive.machine.removed(at(1s));
  EXPECT_EQ(drive.machine.state(), PathState::kDead);
  EXPECT_FALSE(drive.machine.next_timeout());
}

// Heartbeats pass, data does not: keep-alives prove only themselves.
TEST(PathMachine, APathThatIsHeardButDeliversNoDataIsLatchedUntilProofHasLasted) {
  PathMachine m;
  m.set_pace(at(0s), {40ms, 2ms, {}, 50ms});
  TimePoint now = at(0s);
  const auto run = [&](Duration until, bool data_passes) {
    for (; now < at(until); now += 10ms) {
      if (m.next_timeout() && *m.next_timeout() <= now) m.handle_timeout(now);
      m.sent(now, true);
      m.heard(now);
      m.delivered(now, now - 40ms, false);
      if (data_passes) m.delivered(now, now - 40ms, true);
    }
  };
  run(3s, true);
  EXPECT_EQ(m.state(), PathState::kOk);
  run(3900ms, false);
  EXPECT_TRUE(m.usable());
  run(4100ms, false);
  EXPECT_EQ(m.state(), PathState::kLatched);
  run(6s, true);
  EXPECT_EQ(m.state(), PathState::kLatched) << "proof for 1.9 s, two windows are 2 s";
  run(6200ms, true);
  EXPECT_EQ(m.state(), PathState::kOk);
  EXPECT_LT(m.share(now), 0.4);
}

TEST(PathMachine, TheLastUsablePathStaysSuspect) {
  Drive drive({.rtt = 40ms});
  drive.machine.set_last_usable(true);
  drive.run(2s, true);
  drive.run(4s, false);
  EXPECT_EQ(drive.machine.state(), PathState::kSuspect);
  drive.machine.set_last_usable(false);
  drive.run(4100ms, false);
  EXPECT_EQ(drive.machine.state(), PathState::kPulled);
  drive.machine.set_last_usable(true);
  drive.run(4200ms, false);
  EXPECT_EQ(drive.machine.state(), PathState::kSuspect);
}

TEST(PathMachine, ALongQueueIsSuspectWithHysteresis) {
  PathMachine m;
  const auto queue = [&m](TimePoint now, Duration q) {
    m.heard(now);
    m.set_pace(now, {40ms, 2ms, q, 50ms});
    return m.state();
  };
  EXPECT_EQ(queue(at(0s), 100ms), PathState::kOk);
  EXPECT_EQ(queue(at(10ms), 130ms), PathState::kSuspect);
  EXPECT_EQ(queue(at(20ms), 70ms), PathState::kSuspect);
  EXPECT_EQ(queue(at(30ms), 50ms), PathState::kOk);
  EXPECT_EQ(queue(at(40ms), 100ms), PathState::kOk);
}

TEST(PathMachine, OutageIsTheShareOfTheLastMinute) {
  Drive drive({.rtt = 40ms});
  drive.run(30s, true);
  EXPECT_EQ(drive.machine.outage(at(30s)), 0);
  drive.run(33s, false);
  EXPECT_NEAR(drive.machine.outage(at(33s)), 3.0 / 33, 0.01);
  drive.run(90s, true);
  EXPECT_NEAR(drive.machine.outage(at(90s)), 3.0 / 60, 0.02);
  drive.run(100s, true);
  EXPECT_EQ(drive.machine.outage(at(100s)), 0);
}

// Stalls of 100 to 800 ms every second or so and 20 % loss, for ten minutes, many seeds: a pull
// needs more silence each time, so that pulls become rare.
TEST(PathMachine, AMarginalPathDoesNotFlap) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Drive drive({.rtt = 40ms, .loss = 0.2, .seed = seed});
    std::mt19937_64 random(seed);
    std::uniform_int_distribution<int> good(500, 3000);
    std::uniform_int_distribution<int> stall(100, 800);
    Duration t{};
    while (t < 600s) {
      drive.run(t += good(random) * 1ms, true);
      drive.run(t += stall(random) * 1ms, false);
    }
    std::size_t pulls = 0;
    for (const auto& [when, to] : drive.log) pulls += to == PathState::kPulled ? 1U : 0U;
    // Four to reach the longest patience, then one per minute forgiven.
    EXPECT_LE(pulls, 4U + 10U) << seed;
    EXPECT_EQ(drive.first(PathState::kLatched, at(0s)), std::nullopt) << seed;
    EXPECT_EQ(drive.first(PathState::kDead, at(0s)), std::nullopt) << seed;
  }
}

// Whatever happens: a latched path stays so for two proof windows at least, death takes seconds of
// silence, timeouts that were handled are not due again, and every change has a reason.
TEST(PathMachineProperty, NeverFlapsFasterThanItsDwell) {
  EXPECT_TRUE(rc::check([] {
    PathMachine m;
    TimePoint now{};
    TimePoint heard{};
    TimePoint latched{};
    const auto rtt = std::chrono::milliseconds(*rc::gen::inRange(1, 300));
    m.set_pace(now, {rtt, rtt / 4, {}, 100ms});
    const auto steps = *rc::gen::container<std::vector<std::pair<int, int>>>(
        rc::gen::pair(rc::gen::inRange(0, 6), rc::gen::inRange(0, 400)));
    for (const auto& [what, ms] : steps) {
      now += std::chrono::milliseconds(ms);
      const auto due = m.next_timeout();
      if (due && *due <= now) m.handle_timeout(now);
      RC_ASSERT(!m.next_timeout() || *m.next_timeout() > now);
      switch (what) {
        case 0:
        case 1:
          for (int i = 0; i < 4; ++i) m.sent(now, true);
          break;
        case 2:
          heard = now;
          m.heard(now);
          break;
        case 3:
          heard = now;
          m.heard(now);
          m.delivered(now, now - rtt, true);
          break;
        case 4:
          heard = now;
          m.heard(now);
          m.delivered(now, now - rtt, false);
          break;
        default:
          m.set_last_usable(ms % 2 == 0);
          m.handle_timeout(now);
      }
      while (const auto change = m.poll_change()) {
        RC_ASSERT(!change->reason.empty());
        RC_ASSERT(change->from != change->to);
        if (change->to == PathState::kLatched) latched = now;
        if (change->from == PathState::kLatched && change->to == PathState::kOk) {
          RC_ASSERT(now - latched >= 2s);
        }
        RC_ASSERT((change->to != PathState::kDead || now - heard >= PathMachine::kDeadSilence));
      }
      const double outage = m.outage(now);
      RC_ASSERT(outage >= 0 && outage <= 1);
      RC_ASSERT(m.share(now) >= 0 && m.share(now) <= 1);
    }
  }));
}

}  // namespace
}  // namespace interneuron::link::path_machine_test
