// Small messages that come often, over links that lose some of their packets, with deadlines that
// leave no time to ask for anything again.
#include <cstdio>

#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::small_messages_test {
namespace {

constexpr std::size_t kMessages = kSanitized ? 500 : 4000;

struct Figures {
  std::size_t missed = 0;
  // IP bytes that both hosts sent for each byte of a message.
  double ratio = 0;
};

// Messages of 3 kB at 100 Hz, 39 ms one way, deadline 60 ms.
Figures run(const char* policy, std::size_t links, double loss, Duration period = 10ms) {
  constexpr std::size_t kBytes = 3000;
  std::vector<emu::LinkProfile> profiles;
  for (std::size_t i = 0; i < links; ++i) {
    profiles.push_back(constant_link(i == 0 ? "a" : "b", 78, 60, 60, loss));
  }
  Duo s(profiles,
        {.policy = policy, .variants = {kBytes}, .deadline = 60ms, .period = period, .seed = 3});
  const auto sent = [&s, links] {
    std::uint64_t bytes = 0;
    for (std::size_t i = 0; i < links; ++i) {
      const LinkCounters c =
          s.world.endpoint(s.vehicle).link_counters(LinkId{static_cast<std::uint8_t>(i)});
      bytes += c.sent_bytes + c.sent_packets * kIpUdpBytes;
    }
    return bytes;
  };
  // The links' loss is known by then.
  constexpr std::size_t kBefore = 500;
  s.send(2s, kBefore + kMessages);
  std::uint64_t before = 0;
  s.world.at(2s + kBefore * period, [&] { before = sent(); });
  s.run();
  const Figures out{s.missed(kBefore, kBefore + kMessages),
                    static_cast<double>(sent() - before) / (kMessages * kBytes)};
  std::printf("%s over %zu links, %.0f %% loss: %zu of %zu missed, %llu late, wire ratio %.3f\n",
              policy, links, 100 * loss, out.missed, kMessages,
              static_cast<unsigned long long>(s.world.endpoint(s.road).counters().messages_late),
              out.ratio);
  return out;
}

TEST(SmallMessages, OneSymbolForSomeMakesLossesGood) {
  for (const std::size_t links : {1U, 2U}) {
    const Figures plain = run("best_link", links, 0.01);
    const Figures coded = run("coded", links, 0.01);
    EXPECT_GE(plain.missed, kMessages / 50);
    EXPECT_LE(coded.missed, plain.missed / 5);
    EXPECT_LE(coded.ratio, plain.ratio + 0.2);
  }
}

// Losses are always supposed (src/core/peers/path.cc), so that there are some symbols all the same.
TEST(SmallMessages, CleanLinksCostLittle) {
  const Figures plain = run("best_link", 1, 0);
  const Figures coded = run("coded", 1, 0);
  EXPECT_EQ(coded.missed, 0U);
  EXPECT_LE(coded.ratio, plain.ratio + 0.14);
}

}  // namespace
}  // namespace interneuron::sim::small_messages_test
