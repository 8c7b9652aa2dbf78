// What symbols, shares and shadows are for: losses that leave no time to ask again, messages that
// one link does not bring in time, and links that fall silent. Short forms of longer series, with
// the share that may be missed in the long run and room for chance: four standard deviations of a
// binomial count.
#include <cmath>
#include <cstdio>

#include "stream.h"

namespace interneuron::sim {
namespace {

constexpr std::size_t kImage = 128 * 1024;

// Losses in bursts, of this share of all packets and this mean length.
emu::LinkProfile with_bursts(emu::LinkProfile link, double share, double length) {
  const double r = 1 / length;
  link.up.gilbert_elliott = emu::GilbertElliott{.p = r * share / (1 - share), .r = r};
  return link;
}

// IP bytes that leave the vehicle by all links from now on.
class WireCount {
 public:
  WireCount(World& world, std::size_t links) : world_(world), links_(links), before_(sum()) {}
  double per(std::size_t payload) const {
    return static_cast<double>(sum() - before_) / static_cast<double>(payload);
  }

 private:
  std::uint64_t sum() const {
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < links_; ++i) {
      bytes += world_.stats(LinkId{static_cast<std::uint8_t>(i)}, true).bytes_in;
    }
    return bytes;
  }
  World& world_;
  std::size_t links_;
  std::uint64_t before_;
};

struct Point {
  const char* name;
  const char* policy;
  std::vector<emu::LinkProfile> links;
  Duration deadline{};
  std::size_t bytes = kImage;
  Duration period = 100ms;
  // The share of messages that may be missed, and the bytes on the wire for each byte.
  double missed = 0;
  double ratio = 0;
};

std::vector<Point> points() {
  const auto far = [](double loss) {
    return std::vector{constant_link("a", 78, 60, 60, loss), constant_link("b", 78, 20, 20, loss)};
  };
  const auto near = [](double loss) {
    return std::vector{constant_link("a", 30, 60, 60, loss), constant_link("b", 60, 20, 20, loss)};
  };
  auto bursts = far(0);
  for (emu::LinkProfile& link : bursts) link = with_bursts(link, 0.01, 8);
  const std::vector half{constant_link("a", 30, 20, 20), constant_link("b", 50, 20, 20)};
  return {{"Losses", "coded", far(0.01), 130ms, kImage, 100ms, 0.001, 1.16},
          {"Bursts", "coded", bursts, 130ms, kImage, 100ms, 0.015, 1.25},
          {"NearLosses", "coded", near(0.01), 100ms, kImage, 100ms, 0.0002, 1.12},
          {"Clean", "coded", near(0), 100ms, kImage, 100ms, 0, 1.10},
          {"TwoHalves", "stripe", half, 130ms, 384 * 1024, 125ms, 0, 1.10}};
}

class Coding : public testing::TestWithParam<Point> {};

TEST_P(Coding, FewAreMissedForFewBytes) {
  const Point& point = GetParam();
  constexpr std::size_t kMessages = kSanitized ? 100 : 600;
  Stream s(point.links, {.policy = point.policy,
                         .variants = {point.bytes},
                         .deadline = point.deadline,
                         .period = point.period,
                         .seed = 17});
  s.send(2s, kMessages);
  std::optional<WireCount> wire;
  s.world.at(1999ms, [&] { wire.emplace(s.world, point.links.size()); });
  s.run();
  const double expected = point.missed * static_cast<double>(kMessages);
  const double ratio = wire->per(kMessages * point.bytes);
  std::printf("%s: %zu of %zu missed, wire ratio %.3f\n", point.name, s.missed(), kMessages, ratio);
  EXPECT_LE(static_cast<double>(s.missed()), expected + 4 * std::sqrt(expected));
  EXPECT_LE(ratio, point.ratio);
}

INSTANTIATE_TEST_SUITE_P(Points, Coding, testing::ValuesIn(points()),
                         [](const auto& p) { return std::string(p.param.name); });

// Repairs of what symbols stand for would be bytes for nothing.
TEST(Coding, AMessageThatIsDecodedAsksForNothing) {
  Stream s({constant_link("a", 78, 60, 60, 0.01), constant_link("b", 78, 20, 20, 0.01)},
           {.policy = "coded", .variants = {kImage}, .deadline = 130ms, .seed = 5});
  s.send(2s, 100);
  s.run();
  std::uint64_t symbols = 0;
  std::uint64_t resent = 0;
  std::uint64_t lost = 0;
  for (const LinkId link : {LinkId{0}, LinkId{1}}) {
    const LinkCounters c = s.world.endpoint(s.vehicle).link_counters(link);
    symbols += c.symbols_sent;
    resent += c.fragments_resent;
    lost += c.fragments_lost;
  }
  EXPECT_EQ(s.missed(), 0U);
  EXPECT_GT(symbols, 100U);
  // What was made good by symbols is lost all the same, for the control of congestion.
  EXPECT_GT(lost, 60U);
  EXPECT_LT(resent, lost);
}

// Users of bonded links ask most for this: a second modem must not make it worse.
TEST(Coding, ASlowLinkMoreNeverRaisesMisses) {
  for (const char* policy : {"stripe", "coded"}) {
    for (const double slow : {2.0, 8.0, 20.0}) {
      for (const double loss : {0.0, 0.01}) {
        const auto missed = [&](bool both) {
          std::vector links{constant_link("a", 40, 40, 40, loss)};
          if (both) links.push_back(constant_link("b", 160, slow, slow, loss));
          Stream s(links, {.policy = policy, .variants = {kImage}, .deadline = 120ms, .seed = 23});
          s.send(2s, kSanitized ? 30 : 150);
          s.run();
          return s.missed();
        };
        EXPECT_LE(missed(true), missed(false) + (loss > 0 ? 1 : 0))
            << policy << ", " << slow << " Mbit/s, loss " << loss;
      }
    }
  }
}

// The first link is dark for five seconds from any instant of a message's time on.
TEST(Coding, AHoleCostsQualityOfTwoMessagesAtMost) {
  for (const char* policy : {"shadow", "stripe", "coded"}) {
    for (int phase = 0; phase < (kSanitized ? 2 : 10); ++phase) {
      Stream s({constant_link("a", 30, 60, 60), constant_link("b", 60, 20, 20)},
               {.policy = policy, .variants = {kImage, kImage / 4}});
      s.send(2s, 80);
      const Duration dark = 4s + phase * 10ms;
      s.world.at(dark, [&s] { s.world.outage(s.world.wire_of(LinkId{0}), s.world.now(), 5s); });
      s.run();
      EXPECT_LE(s.missed(), 1U) << policy << ", phase " << phase;
      EXPECT_LE(s.degraded(), 2U) << policy << ", phase " << phase;
    }
  }
}

}  // namespace
}  // namespace interneuron::sim
