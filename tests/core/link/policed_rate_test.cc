// What a policer lets pass is found from losses, and losses by chance are taken for none.
#include "core/link/policed_rate.h"

#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <random>
#include <vector>

namespace interneuron::link::policed_rate_test {
namespace {

using namespace std::chrono_literals;

constexpr std::uint32_t kBytes = 1250;

// A sender that obeys the cap, and what is on its way; what became of a packet is known a round
// trip after it left.
class Way {
 public:
  // Sends as fast as the cap and `pace` allow, for so long, or in every 100 ms for `busy` of them.
  void send(Duration length, DataRate pace, Duration busy = 100ms, Duration queue = {}) {
    const TimePoint end = now_ + length;
    while (now_ < end) {
      const Duration in_period{now_.time_since_epoch().count() % Duration(100ms).count()};
      if (in_period < busy) {
        told_.push_back({now_, kBytes, passes()});
        ++sent_;
        if (!told_.back().arrived) ++lost_;
      }
      now_ += std::min(pace, rate_.cap().value_or(pace)).transmit_time(kBytes);
      tell(queue);
    }
  }
  void police(DataRate rate, double bytes) {
    policer_ = rate;
    depth_ = tokens_ = bytes;
  }
  void lose(double share) { chance_ = std::bernoulli_distribution(share); }
  std::optional<DataRate> cap() const { return rate_.cap(); }
  // The share of packets that was lost since it was asked for last.
  double share_lost() {
    const double share = static_cast<double>(lost_) / static_cast<double>(sent_);
    lost_ = sent_ = 0;
    return share;
  }

 private:
  static constexpr Duration kRoundTrip = 40ms;

  bool passes() {
    if (chance_(random_)) return false;
    if (!policer_) return true;
    tokens_ += to_seconds(now_ - filled_at_) * static_cast<double>(policer_->bits_per_second) / 8;
    tokens_ = std::min(tokens_, depth_);
    filled_at_ = now_;
    if (tokens_ < kBytes) return false;
    tokens_ -= kBytes;
    return true;
  }
  void tell(Duration queue) {
    std::size_t known = 0;
    while (known < told_.size() && told_[known].left_at + kRoundTrip <= now_) ++known;
    rate_.passed(now_, std::span(told_).first(known), queue);
    told_.erase(told_.begin(), told_.begin() + static_cast<std::ptrdiff_t>(known));
  }

  PolicedRate rate_;
  TimePoint now_{1s};
  TimePoint filled_at_{};
  std::optional<DataRate> policer_;
  double depth_ = 0;
  double tokens_ = 0;
  std::vector<Passage> told_;
  std::uint64_t sent_ = 0;
  std::uint64_t lost_ = 0;
  std::mt19937_64 random_{7};
  std::bernoulli_distribution chance_{0};
};

TEST(PolicedRate, IsWhatArrivesBetweenLosses) {
  for (const double mbit : {3.0, 10.0, 50.0}) {
    for (const Duration bucket : {10ms, 50ms, 200ms}) {
      Way way;
      way.police(DataRate::mbit(mbit), mbit * 1e6 / 8 * to_seconds(bucket));
      way.send(3s, DataRate::mbit(40 * mbit));
      ASSERT_TRUE(way.cap()) << mbit << ' ' << to_ms(bucket);
      way.share_lost();
      way.send(20s, DataRate::mbit(40 * mbit));
      ASSERT_TRUE(way.cap()) << mbit << ' ' << to_ms(bucket);
      EXPECT_NEAR(way.cap()->mbit(), mbit, 0.2 * mbit) << to_ms(bucket);
      EXPECT_LE(way.share_lost(), 0.02) << mbit << ' ' << to_ms(bucket);
    }
  }
}

TEST(PolicedRate, FollowsAStepUpAndDown) {
  Way way;
  way.police(DataRate::mbit(10), 62'500);
  way.send(5s, DataRate::mbit(40));
  way.police(DataRate::mbit(3), 62'500);
  way.send(5s, DataRate::mbit(40));
  ASSERT_TRUE(way.cap());
  EXPECT_NEAR(way.cap()->mbit(), 3, 0.6);
  way.police(DataRate::mbit(10), 62'500);
  way.send(20s, DataRate::mbit(40));
  ASSERT_TRUE(way.cap());
  EXPECT_NEAR(way.cap()->mbit(), 10, 2);
}

TEST(PolicedRate, IsForgottenWhereNobodyPolicesAnyMore) {
  Way way;
  way.police(DataRate::mbit(10), 62'500);
  way.send(5s, DataRate::mbit(40));
  ASSERT_TRUE(way.cap());
  way.police(DataRate::mbit(1000), 1e6);
  way.send(25s, DataRate::mbit(40));
  EXPECT_TRUE(!way.cap() || *way.cap() > DataRate::mbit(40));
}

TEST(PolicedRate, LossesByChanceAreNone) {
  for (const double share : {0.01, 0.05, 0.1}) {
    Way way;
    way.lose(share);
    way.send(60s, DataRate::mbit(20), 50ms);
    EXPECT_FALSE(way.cap()) << share;
  }
  // Where so much is lost a policer may seem to be there, but not for long.
  Way way;
  way.lose(0.25);
  int capped = 0;
  for (int i = 0; i < 200; ++i) {
    way.send(100ms, DataRate::mbit(20));
    if (way.cap()) ++capped;
  }
  EXPECT_LE(capped, 20);
}

TEST(PolicedRate, LossesInAQueueAreARoutersOwn) {
  Way way;
  way.police(DataRate::mbit(10), 62'500);
  way.send(10s, DataRate::mbit(40), 100ms, 20ms);
  EXPECT_FALSE(way.cap());
}

TEST(PolicedRate, SinglePacketsTellNone) {
  Way way;
  way.lose(0.3);
  way.send(60s, DataRate::mbit(0.1));
  EXPECT_FALSE(way.cap());
}

}  // namespace
}  // namespace interneuron::link::policed_rate_test
