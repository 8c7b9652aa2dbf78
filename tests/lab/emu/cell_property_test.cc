// Whatever a cell is like and whoever shares it: no packet is made or forgotten, each flow stays in
// order, the queue keeps its limit, and the bottleneck never rests while a packet waits.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>

#include "lab/emu/cell.h"
#include "support.h"

namespace interneuron::emu::cell_property_test {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

CellParams some_cell() {
  CellParams params;
  params.rate = DataRate::mbit(*rc::gen::element(0.5, 8.0, 50.0));
  params.queue_bytes = *rc::gen::element<std::size_t>(0, 3000, 20'000, 200'000);
  params.mtu = *rc::gen::element<std::size_t>(0, 1400);
  if (*rc::gen::arbitrary<bool>()) {
    params.codel = CoDelParams{milliseconds(1), milliseconds(10)};
  }
  if (*rc::gen::arbitrary<bool>()) params.mark_above = milliseconds(1);
  const int kind = *rc::gen::inRange(0, 4);
  if (kind == 0) {
    params.trace = std::make_shared<const Opportunities>(Opportunities{{0, 3, 3, 7, 20}});
  } else if (kind == 1) {
    params.trace = std::make_shared<const SteppedRate>(SteppedRate{
        {{Duration{}, DataRate::mbit(4)}, {milliseconds(50), DataRate{}}}, milliseconds(80)});
  }
  return params;
}

Cell::Packet some_packet(std::uint64_t tag) {
  return {tag, *rc::gen::inRange<std::uint32_t>(0, 3), *rc::gen::inRange<std::size_t>(40, 1501),
          static_cast<Ecn>(*rc::gen::inRange(0, 4))};
}

struct Ledger {
  std::map<std::uint64_t, Cell::Packet> inside;
  std::uint64_t last_tag = 0;
  Duration last_at{};

  void take(Cell& cell, Duration now) {
    for (;;) {
      const auto announced = cell.next_departure();
      const auto departed = cell.dequeue(now);
      RC_ASSERT(departed.has_value() == (announced && *announced <= now));
      if (!departed) return;
      RC_ASSERT(departed->at >= last_at);
      RC_ASSERT(departed->at <= now);
      RC_ASSERT(departed->packet.tag >= last_tag);
      last_at = departed->at;
      last_tag = departed->packet.tag;
      const auto entered = inside.find(departed->packet.tag);
      RC_ASSERT(entered != inside.end());
      RC_ASSERT(departed->packet.flow == entered->second.flow);
      RC_ASSERT(!departed->dropped || entered->second.ecn == Ecn::kNotEct);
      const bool same = departed->packet.ecn == entered->second.ecn;
      RC_ASSERT(same || (departed->packet.ecn == Ecn::kCe && is_ect(entered->second.ecn)));
      inside.erase(entered);
    }
  }
};

RC_GTEST_PROP(CellProperty, PacketsAreConservedAndInOrder, ()) {
  const CellParams params = some_cell();
  Cell cell(params);
  Ledger ledger;
  Duration now{};
  for (std::uint64_t tag = 0; tag < 300; ++tag) {
    now += microseconds(*rc::gen::inRange(0, 2000));
    const Cell::Packet packet = some_packet(tag);
    if (cell.enqueue(now, packet)) ledger.inside[tag] = packet;
    RC_ASSERT(cell.waiting_bytes() <= std::max<std::size_t>(params.queue_bytes, 1500));
    if (*rc::gen::arbitrary<bool>()) ledger.take(cell, now);
  }
  ledger.take(cell, now + std::chrono::hours(1));
  RC_ASSERT(ledger.inside.empty());
  RC_ASSERT(cell.waiting_bytes() == 0);
  CellStats sum;
  for (std::uint32_t flow = 0; flow < 3; ++flow) {
    const CellStats& s = cell.stats(flow);
    RC_ASSERT(s.packets_in == s.delivered + s.queue_drops + s.codel_drops + s.too_big);
    sum.packets_in += s.packets_in;
    sum.bytes_delivered += s.bytes_delivered;
    sum.marked += s.marked;
  }
  RC_ASSERT(sum.packets_in == 300);
  RC_ASSERT(sum.bytes_delivered == cell.stats().bytes_delivered);
  RC_ASSERT(sum.marked == cell.stats().marked);
}

// Work conservation: while packets wait, each leaves as soon as the rate allows after the one
// before it.
RC_GTEST_PROP(CellProperty, TheBottleneckNeverRestsWhileAPacketWaits, ()) {
  CellParams params = some_cell();
  params.trace.reset();
  params.queue_bytes = 200'000;
  Cell cell(params);
  std::map<std::uint64_t, Duration> arrived;
  Duration now{};
  for (std::uint64_t tag = 0; tag < 200; ++tag) {
    now += microseconds(*rc::gen::inRange(0, 2000));
    if (cell.enqueue(now, some_packet(tag))) arrived[tag] = now;
  }
  Duration free{};
  while (const auto departed = cell.dequeue(kEver)) {
    if (departed->dropped) continue;
    const Duration began = std::max(free, arrived[departed->packet.tag]);
    const Duration took = departed->at - began;
    const Duration needed = params.rate.transmit_time(departed->packet.ip_bytes);
    RC_ASSERT(took >= needed - Duration{1});
    RC_ASSERT(took <= needed + Duration{1});
    free = departed->at;
  }
}

// Without management a cell is the bottleneck of a link without delay.
RC_GTEST_PROP(CellProperty, AloneItIsTheBottleneckOfALink, ()) {
  CellParams params = some_cell();
  params.codel.reset();
  params.mark_above.reset();
  DirectionParams direction{.rate = params.rate,
                            .queue_bytes = params.queue_bytes,
                            .trace = params.trace,
                            .mtu = params.mtu};
  LinkModel link = constant_link(direction, 0);
  Cell cell(params);
  Duration now{};
  for (std::uint64_t tag = 0; tag < 200; ++tag) {
    now += microseconds(*rc::gen::inRange(0, 2000));
    const Cell::Packet packet = some_packet(tag);
    RC_ASSERT(cell.enqueue(now, packet) == link.enqueue(now, packet.ip_bytes, tag));
  }
  for (const LinkModel::Packet& packet : drain(link)) {
    const auto departed = cell.dequeue(kEver);
    RC_ASSERT(departed);
    RC_ASSERT(departed->packet.tag == packet.tag);
    RC_ASSERT(departed->at == packet.due);
  }
  RC_ASSERT(cell.stats().queue_drops == link.stats().queue_drops);
}

}  // namespace
}  // namespace interneuron::emu::cell_property_test
