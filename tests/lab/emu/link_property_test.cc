// Whatever a link is like and whatever is done to it: no packet is made or forgotten, none arrives
// before its time, and none overtakes unless reordering is on.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "support.h"

namespace interneuron::emu::link_property_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

std::uint64_t accounted(const DirectionStats& s) {
  return s.delivered + s.lost + s.queue_drops + s.outage_lost + s.too_big + s.nat_drops + s.policed;
}

double some_probability() { return *rc::gen::element(0.0, 0.05, 0.5); }

RateTrace some_trace() {
  if (*rc::gen::arbitrary<bool>()) {
    SteppedRate steps{{{Duration{}, DataRate::mbit(4)}, {milliseconds(50), DataRate{}}},
                      milliseconds(80)};
    return std::make_shared<const SteppedRate>(steps);
  }
  return std::make_shared<const Opportunities>(Opportunities{{0, 3, 3, 7, 20}});
}

DirectionParams some_params(bool reorder) {
  DirectionParams p = rate_of_mbit(*rc::gen::element(0.5, 5.0, 50.0),
                                   *rc::gen::element<std::size_t>(3000, 20'000, 200'000));
  p.queue_packets = *rc::gen::element<std::size_t>(0, 5);
  if (*rc::gen::arbitrary<bool>()) p.trace = some_trace();
  p.duplicate = some_probability();
  p.corrupt = some_probability();
  if (*rc::gen::arbitrary<bool>()) p.loss = some_probability();
  if (*rc::gen::arbitrary<bool>()) p.gilbert_elliott = GilbertElliott{0.1, 0.3};
  p.mtu = *rc::gen::element<std::size_t>(0, 1400);
  if (*rc::gen::arbitrary<bool>()) p.police = {DataRate::mbit(5), 5000};
  if (*rc::gen::arbitrary<bool>()) p.shape = {DataRate::mbit(2), 4000};
  p.grant_every = *rc::gen::element<Duration>(Duration{}, milliseconds(5));
  p.harq = some_probability();
  if (*rc::gen::arbitrary<bool>()) {
    p.wake_after = milliseconds(20);
    p.wake_by = milliseconds(30);
  }
  if (reorder) {
    p.reorder = some_probability();
    p.reorder_by = *rc::gen::element<Duration>(milliseconds(3), seconds(60));
  }
  return p;
}

LinkProfile some_profile(bool reorder) {
  LinkProfile profile =
      profile_of(*rc::gen::element<std::string>("4g", "5g", "lte-sprint-highway"));
  profile.up = some_params(reorder);
  profile.down = some_params(reorder);
  if (*rc::gen::arbitrary<bool>())
    profile.outages = {milliseconds(50), milliseconds(20), milliseconds(90)};
  if (reorder && *rc::gen::arbitrary<bool>())
    profile.nat = {60, 1440, 0.3, milliseconds(2), seconds(1)};
  return profile;
}

// Follows one direction: what went in when, what came out.
struct Ledger {
  std::map<std::uint64_t, Duration> entered;  // those inside
  std::uint64_t given_up = 0;
  std::uint64_t last_tag = 0;
  Duration last_due{};

  void take(LinkModel& model, Duration now, bool in_order) {
    const auto announced = model.next_delivery();
    const auto packet = model.dequeue(now);
    RC_ASSERT(packet.has_value() == (announced && *announced <= now));
    if (!packet) return;
    RC_ASSERT(packet->due == *announced);
    RC_ASSERT(packet->due >= last_due);
    last_due = packet->due;
    RC_ASSERT(entered.count(packet->tag) == 1);
    RC_ASSERT(packet->due >= entered[packet->tag]);
    if (in_order) RC_ASSERT(packet->tag >= last_tag);
    last_tag = packet->tag;
    if (packet->last) entered.erase(packet->tag);
    take(model, now, in_order);
  }
};

void change_something(Link& link, Duration now, bool reorder) {
  switch (*rc::gen::inRange(0, 12)) {
    case 0: {
      LinkChange change;
      change.rtt = milliseconds(*rc::gen::inRange(0, 300));
      return link.change(now, change);
    }
    case 1: {
      LinkChange change;
      DirectionChange& up = change.direction(Direction::kUp);
      up.rate = DataRate::mbit(*rc::gen::element(0.1, 100.0));
      up.shape_rate = DataRate::mbit(*rc::gen::element(0.0, 0.5, 20.0));
      return link.change(now, change);
    }
    case 2: {
      LinkChange change;
      change.profile = std::make_shared<const LinkProfile>(some_profile(reorder));
      return link.change(now, change);
    }
    case 3:
      return link.outage(now + milliseconds(*rc::gen::inRange(0, 10)), milliseconds(10));
    default:
      return;
  }
}

void keeps_the_books(bool reorder) {
  const LinkProfile profile = some_profile(reorder);
  Link link(profile, *rc::gen::arbitrary<std::uint64_t>());
  std::array<Ledger, kDirections> ledgers;
  const std::array models{&link.up(), &link.down()};
  Duration now = milliseconds(*rc::gen::inRange(0, 2000));
  // Few, or finding the smallest failing case would take minutes.
  const auto gaps_us = *rc::gen::container<std::vector<int>>(200, rc::gen::inRange(0, 8000));
  std::uint64_t tag = 0;
  for (const int gap_us : gaps_us) {
    now += gap_us % 3 == 0 ? Duration{} : microseconds(gap_us);
    const std::size_t d = gap_us % 4 == 1 ? 1 : 0;
    const auto bytes = static_cast<std::size_t>(40 + gap_us % 1460);
    if (models[d]->enqueue(now, bytes, ++tag)) ledgers[d].entered[tag] = now;
    change_something(link, now, reorder);
    for (std::size_t i = 0; i < kDirections; ++i) ledgers[i].take(*models[i], now, !reorder);
  }
  for (std::size_t i = 0; i < kDirections; ++i) {
    ledgers[i].take(*models[i], kEver, !reorder);
    RC_ASSERT(ledgers[i].entered.empty());
    const DirectionStats& stats = models[i]->stats();
    RC_ASSERT(stats.packets_in + stats.duplicated == accounted(stats));
  }
}

RC_GTEST_PROP(LinkProperty, KeepsTheBooksAndTheOrder, ()) { keeps_the_books(false); }

RC_GTEST_PROP(LinkProperty, KeepsTheBooksWhenReordering, ()) { keeps_the_books(true); }

RC_GTEST_PROP(LinkProperty, IsTheSameForTheSameSeed, ()) {
  const LinkProfile profile = some_profile(true);
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  Link a(profile, seed);
  Link b(profile, seed);
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Duration now = milliseconds(2) * static_cast<std::int64_t>(i);
    RC_ASSERT(a.up().enqueue(now, 1000, i) == b.up().enqueue(now, 1000, i));
    RC_ASSERT(a.up().next_delivery() == b.up().next_delivery());
    if (i % 3 == 0) RC_ASSERT(tags(drain(a.up(), now)) == tags(drain(b.up(), now)));
  }
}

}  // namespace
}  // namespace interneuron::emu::link_property_test
