#include "app/watch/screen.h"

#include <gmock/gmock.h>
#include <rapidcheck/gtest.h>

#include "app/watch/table.h"
#include "links_support.h"

namespace interneuron::watch::screen_test {
namespace {

using testing::HasSubstr;
using testing::Not;

LinksHistory history_of(std::size_t links, std::size_t samples, std::size_t events) {
  LinksHistory history;
  for (std::size_t i = 0; i < samples; ++i) {
    LinksSnapshot s = made_up_snapshot();
    s.rows.clear();
    s.events.clear();
    for (std::size_t l = 0; l < links; ++l) {
      s.rows.push_back({made_up_nic("wwan" + std::to_string(l), "10.0.0.2"),
                        made_up_figures(20 + static_cast<double>(i))});
    }
    for (std::size_t e = 0; e < events; ++e) {
      s.events.push_back({TimePoint{from_ms(90'000 + 10.0 * static_cast<double>(e))}, "wwan0", "ok",
                          "suspect", "silent for " + std::to_string(e) + " ms"});
    }
    history.add(std::move(s));
  }
  return history;
}

TEST(Screen, ShowsFiguresHistoryScoresAndChanges) {
  LinksHistory history;
  history.add(made_up_snapshot());
  const std::string text = plain_text(draw(history, {.width = 120}));
  EXPECT_THAT(text, HasSubstr("measured by vehicle (process 7)"));
  EXPECT_THAT(text,
              testing::ContainsRegex("wwan0 .*ready .*ok .*20\\.0 +30\\.0 +1\\.5 +1\\.3 +50"));
  EXPECT_THAT(text, HasSubstr("≤20 ms"));  // the scale: 20 ms is its top
  EXPECT_THAT(text, HasSubstr("delay ████████████ 1.00"));
  EXPECT_THAT(text, HasSubstr("bandwidth ██████······ 0.50"));
  EXPECT_THAT(text, HasSubstr("wwan1       ready → no_carrier  carrier lost"));
  EXPECT_THAT(text, testing::ContainsRegex("wwan1 .*no_carrier .*carrier lost"));
}

TEST(Screen, ShowsWhatIsKeptOfPeers) {
  LinksHistory history;
  history.add(made_up_snapshot());
  const std::string text = plain_text(draw(history, {.width = 120}));
  EXPECT_THAT(text, HasSubstr("vehicle (process 7): 2 peers, longest stall of its loop 4.5 ms"));
  EXPECT_THAT(text,
              HasSubstr("peer 4  3 rounds, 2 held (5 KB), 1 incomplete (12 KB)  340 computed, 9 "
                        "not, 1 waiting, 12.3 s  limited: origin 7"));
  // It holds nothing, and nothing has struck it.
  EXPECT_THAT(text, Not(HasSubstr("peer 5")));
}

TEST(Screen, SaysWhyAPathIsNotUsed) {
  LinksSnapshot s = made_up_snapshot();
  s.rows[0].measured->state.path = PathState::kPulled;
  s.rows[0].measured->path_reason = "silent for 130 ms under load";
  LinksHistory history;
  history.add(s);
  EXPECT_THAT(plain_text(draw(history, {.width = 100})),
              HasSubstr("pulled: silent for 130 ms under load"));
}

TEST(Screen, KeepsEachChangeOnce) {
  const LinksHistory history = history_of(1, 5, 3);
  EXPECT_EQ(history.events().size(), 3U);
  const std::string text = plain_text(draw(history, {}));
  EXPECT_LT(text.find("silent for 2 ms"), text.find("silent for 0 ms")) << "the newest is first";
}

TEST(Screen, LeavesOutColumnsWhereThereIsNoRoom) {
  const LinksHistory history = history_of(1, 1, 0);
  EXPECT_THAT(plain_text(draw(history, {.width = 120})), HasSubstr("ADDRESS"));
  const std::string narrow = plain_text(draw(history, {.width = 72}));
  EXPECT_THAT(narrow, Not(HasSubstr("ADDRESS")));
  EXPECT_THAT(narrow, HasSubstr("RTT p50"));
  EXPECT_THAT(narrow, HasSubstr("LOSS %"));
}

TEST(Screen, CountsTheLinksThatDoNotFit) {
  const LinksHistory history = history_of(8, 1, 10);
  const auto lines = draw(history, {.width = 100, .height = 24});
  EXPECT_LE(lines.size(), 24U);
  const std::string text = plain_text(lines);
  EXPECT_THAT(text, HasSubstr("more; a taller window shows them"));
  EXPECT_THAT(text, HasSubstr("changes, newest first"));
  EXPECT_THAT(text, HasSubstr("silent for 9 ms"));
}

TEST(Screen, WithoutUnicodeThereIsOnlyAscii) {
  LinksSnapshot s = made_up_snapshot();
  s.rows.resize(1);
  LinksHistory history;
  history.add(s);
  const std::string text = plain_text(draw(history, {.width = 100, .unicode = false}));
  EXPECT_TRUE(std::ranges::all_of(text, [](char c) { return static_cast<signed char>(c) > 0; }))
      << text;
}

// Whatever there is to show, the window is never overrun.
RC_GTEST_PROP(Screen, FitsIntoAnyWindow, ()) {
  const auto links = *rc::gen::inRange<std::size_t>(0, 9);
  const auto events = *rc::gen::inRange<std::size_t>(0, 30);
  const auto width = *rc::gen::inRange<std::size_t>(1, 200);
  const auto height = *rc::gen::inRange<std::size_t>(1, 60);
  const auto unicode = *rc::gen::arbitrary<bool>();
  const auto lines =
      draw(history_of(links, 2, events), {.width = width, .height = height, .unicode = unicode});
  RC_ASSERT(lines.size() <= height);
  for (const Line& line : lines) {
    std::size_t sum = 0;
    for (const Span& span : line) sum += columns(span.text);
    RC_ASSERT(sum <= width);
  }
}

TEST(Sparkline, IsScaledAndRightAligned) {
  EXPECT_EQ(sparkline({0, 50, 100}, 100, 5, true), "  ▁▅█");
  EXPECT_EQ(sparkline({-1, 100}, 100, 2, true), " █");
  EXPECT_EQ(sparkline({1, 2, 3}, 3, 2, false), "+#");
  EXPECT_EQ(sparkline({}, 1, 3, true), "   ");
}

TEST(Bar, IsAsLongAsItsShare) {
  EXPECT_EQ(bar(0.5, 4, true), "██··");
  EXPECT_EQ(bar(0.9, 2, false), "##");
  EXPECT_EQ(bar(2, 3, false), "###");
  EXPECT_EQ(bar(-1, 3, false), "...");
  EXPECT_EQ(columns(bar(0.99, 8, true)), 8U);
}

}  // namespace
}  // namespace interneuron::watch::screen_test
