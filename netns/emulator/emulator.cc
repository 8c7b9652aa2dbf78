#include "netns/emulator/emulator.h"

#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>

#include "netns/state/precedence.h"
#include "netns/wiring/nic_plan.h"
#include "node/io/steady_clock.h"

namespace interneuron::netns {

namespace {

constexpr std::size_t kEthernetHeader = 14;
constexpr std::uint16_t kEtherTypeIpv4 = 0x0800;
constexpr std::uint16_t kEtherTypeIpv6 = 0x86dd;
constexpr std::uint16_t kEtherTypeArp = 0x0806;
constexpr std::size_t kIpv4Header = 20;
constexpr std::size_t kIpv6Header = 40;
constexpr std::size_t kIpv4Destination = kEthernetHeader + 16;
constexpr std::size_t kIpv6Destination = kEthernetHeader + 24;

// How long before a frame is due the emulator stops sleeping: the wake-up of an idle virtual CPU
// was measured to take 20 to 60 us (docs/constants.md, "The testbed on a machine").
constexpr Duration kSpin = std::chrono::microseconds(60);
// Traffic whose frames follow each other closer than kDense is dense: waking up for each frame
// would take the CPU time that sender and receiver need. Such frames are received and sent in
// groups, kGroup apart, without spinning. Arrivals have the kernel's time stamp, so grouping delays
// a frame only on its way out, by kGroup/2 in the mean.
constexpr Duration kDense = std::chrono::microseconds(200);
constexpr Duration kGroup = std::chrono::microseconds(60);
// How often counters are published and the ring's losses are read: ten times a second is more often
// than a display shows them.
constexpr Duration kHousekeeping = std::chrono::milliseconds(100);
// The most frames received before those that are due are sent, so that a flood cannot delay them:
// 256 take about a millisecond at the fastest rate measured (docs/constants.md, "The testbed on a
// machine").
constexpr std::size_t kTakeInAtOnce = 256;
// Frames received per reading of the clock, which costs 30 ns.
constexpr std::size_t kClockEvery = 8;
// An arrival that seems to be further back than this comes from a step of the wall clock: the ring
// holds frames for less (60 ms of the fastest sender, see kMaxPlaces of frame_hub.cc).
constexpr Duration kOldestArrival = std::chrono::seconds(1);
using io::now;

std::uint16_t ether_type(std::span<const std::byte> frame) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(frame[12]) << 8U |
                                    std::to_integer<unsigned>(frame[13]));
}

enum class Scope : std::uint8_t { kNone, kLink, kGlobal };

unsigned byte_of(std::span<const std::byte> frame, std::size_t at) {
  return std::to_integer<unsigned>(frame[at]);
}

// How far a frame goes. kNone: it is dropped. kLink: it stays between a host and its modem, and so
// is passed on without the model. kGlobal: it crosses the link.
Scope scope_of(std::span<const std::byte> frame) {
  if (frame.size() < kEthernetHeader) return Scope::kNone;
  switch (ether_type(frame)) {
    case kEtherTypeArp:
      return Scope::kLink;
    case kEtherTypeIpv4: {
      if (frame.size() < kEthernetHeader + kIpv4Header) return Scope::kNone;
      // Multicast of link scope is 224.0.0.0/24 (RFC 5771).
      const bool local = byte_of(frame, kIpv4Destination) == 224 &&
                         byte_of(frame, kIpv4Destination + 1) == 0 &&
                         byte_of(frame, kIpv4Destination + 2) == 0;
      return local ? Scope::kLink : Scope::kGlobal;
    }
    case kEtherTypeIpv6: {
      if (frame.size() < kEthernetHeader + kIpv6Header) return Scope::kNone;
      // Link scope is fe80::/10 and, for multicast, ff02::/16 (RFC 4291).
      const unsigned first = byte_of(frame, kIpv6Destination);
      const unsigned second = byte_of(frame, kIpv6Destination + 1);
      const bool local =
          (first == 0xfe && (second & 0xc0U) == 0x80) || (first == 0xff && second == 0x02);
      return local ? Scope::kLink : Scope::kGlobal;
    }
    default:
      return Scope::kNone;
  }
}

// The emulator's NICs, in the order of Emulator::directions_.
std::vector<std::string> ports(const State& state) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < state.links.size(); ++i) {
    const std::size_t vehicle = state.links[i].vehicle;
    const std::size_t network = i % state.network_count();
    out.push_back(vehicle_port(vehicle, network));
    out.push_back(core_port(vehicle, network));
  }
  return out;
}

// Flips one bit behind the headers: another one in each frame, as `number` rises.
void corrupt(std::span<std::byte> frame, std::uint64_t number) {
  if (frame.size() <= kEthernetHeader + kIpv6Header) return;
  const std::size_t payload = frame.size() - kEthernetHeader - kIpv6Header;
  frame[kEthernetHeader + kIpv6Header + number % payload] ^= std::byte{1} << (number % 8);
}

}  // namespace

Emulator::Emulator(const State& state, Bearers& bearers)
    : bearers_(bearers), stats_(bearers.stats()), hub_(ports(state)) {
  for (std::size_t i = 0; i < bearers.size(); ++i) {
    directions_.push_back({2 * i + 1, &bearers.link(i).up(), &bearers.shared(i).up,
                           bearers.cell(i, emu::Direction::kUp)});
    directions_.push_back({2 * i, &bearers.link(i).down(), &bearers.shared(i).down,
                           bearers.cell(i, emu::Direction::kDown)});
  }
  sent_.reserve(FrameHub::kBatch);
  cell_times_.resize(bearers.cells().size());
}

void Emulator::run(int stop_fd) {
  fds_ = {{{hub_.fd(), POLLIN, 0}, {bearers_.attention_fd(), POLLIN, 0}, {stop_fd, POLLIN, 0}}};
  take_precedence();

  while (!stopped_) {
    std::size_t work = take_in(io::wall_offset());
    for (std::size_t i = 0; i < directions_.size(); ++i) work += send_due(i);
    work += send_from_cells();
    const TimePoint present = now();
    if (present >= next_tick_) tick(present);
    if (work > 0) {
      last_work_ = present;
    } else {
      rest();
    }
  }
}

std::size_t Emulator::take_in(Duration offset) {
  std::size_t taken = 0;
  TimePoint present{};
  while (taken < kTakeInAtOnce) {
    const auto frame = hub_.receive();
    if (!frame) break;
    Direction& direction = directions_[frame->nic];
    if (taken++ % kClockEvery == 0) present = now();
    // If the wall clock was set since the frame arrived, its time of arrival is useless, and the
    // present takes its place.
    TimePoint arrival{frame->arrival_realtime - offset};
    if (arrival > present || arrival < present - kOldestArrival) arrival = present;
    arrival = std::max(arrival, direction.last_arrival);
    direction.last_arrival = arrival;
    enter(direction, *frame, arrival);
    hub_.release();
  }
  return taken;
}

void Emulator::enter(Direction& direction, const FrameHub::Frame& frame, TimePoint arrival) {
  const Scope scope = scope_of(frame.bytes);
  if (scope == Scope::kNone) return;
  if (scope == Scope::kLink) {
    const iovec now_or_never{const_cast<std::byte*>(frame.bytes.data()), frame.bytes.size()};
    hub_.send(direction.to, {&now_or_never, 1});
    return;
  }
  if (!bearers_.epoch()) bearers_.start(arrival);
  const std::size_t ip_bytes = frame.bytes.size() - kEthernetHeader;
  const FrameStore::Handle handle = store_.add(frame.bytes);
  if (!direction.model->enqueue(bearers_.since_epoch(arrival), ip_bytes, handle)) {
    store_.release(handle);
    return;
  }
  if (frame.checksum_missing) complete_checksum(store_[handle]);
}

// What has come through the model: into its cell, or out of the link.
std::size_t Emulator::send_due(std::size_t index) {
  Direction& direction = directions_[index];
  if (!bearers_.epoch()) return 0;
  const TimePoint present = now();
  const Duration time = bearers_.since_epoch(present);
  std::size_t count = 0;
  std::size_t passed_on = 0;
  while (count < batch_.size()) {
    const auto packet = direction.model->dequeue(time);
    if (!packet) break;
    if (direction.cell != nullptr && !packet->lost) {
      enter_cell(index, *packet);
      ++passed_on;
      continue;
    }
    const std::span<std::byte> frame = store_[packet->tag];
    if (packet->last) sent_.push_back(packet->tag);
    if (packet->lost) continue;
    if (packet->corrupt) corrupt(frame, stats_.frames_sent.load(std::memory_order_relaxed) + count);
    batch_[count++] = {frame.data(), frame.size()};
    count_lateness(time - packet->due);
  }
  const std::size_t sent = count > 0 ? hub_.send(direction.to, {batch_.data(), count}) : 0;
  for (const FrameStore::Handle handle : sent_) store_.release(handle);
  sent_.clear();
  if (count == 0) return passed_on;
  stats_.frames_sent.fetch_add(sent, std::memory_order_relaxed);
  stats_.kernel_drops.fetch_add(count - sent, std::memory_order_relaxed);
  direction.shared->store(direction.model->stats());
  return count;
}

void Emulator::enter_cell(std::size_t direction, const emu::LinkModel::Packet& packet) {
  const FrameStore::Handle handle = packet.last ? packet.tag : store_.add(store_[packet.tag]);
  const std::span<std::byte> frame = store_[handle];
  if (packet.corrupt) corrupt(frame, stats_.frames_sent.load(std::memory_order_relaxed));
  const emu::Cell::Packet entering{handle, static_cast<std::uint32_t>(direction), packet.ip_bytes,
                                   ecn_of(frame.subspan(kEthernetHeader))};
  emu::Cell& cell = *directions_[direction].cell;
  // It enters when it was due, not when we woke up, or the cell would stand idle for as long as we
  // were late. Frames of other links may have entered since.
  Duration& entered = cell_times_[static_cast<std::size_t>(&cell - bearers_.cells().data())];
  entered = std::max(entered, packet.due);
  if (!cell.enqueue(entered, entering)) store_.release(handle);
}

std::size_t Emulator::send_from_cells() {
  if (!bearers_.epoch()) return 0;
  const Duration time = bearers_.since_epoch(now());
  std::size_t count = 0;
  for (std::size_t i = 0; i < cell_times_.size(); ++i) {
    emu::Cell& cell = bearers_.cells()[i];
    cell_times_[i] = std::max(cell_times_[i], time);
    while (const auto departed = cell.dequeue(cell_times_[i])) {
      const emu::Cell::Packet& packet = departed->packet;
      if (!departed->dropped) {
        const std::span<std::byte> frame = store_[packet.tag];
        if (packet.ecn == emu::Ecn::kCe) mark_congestion(frame.subspan(kEthernetHeader));
        const iovec one{frame.data(), frame.size()};
        const std::size_t sent = hub_.send(directions_[packet.flow].to, {&one, 1});
        stats_.frames_sent.fetch_add(sent, std::memory_order_relaxed);
        stats_.kernel_drops.fetch_add(1 - sent, std::memory_order_relaxed);
        count_lateness(time - departed->at);
      }
      store_.release(packet.tag);
      ++count;
    }
  }
  return count;
}

void Emulator::count_lateness(Duration lateness) {
  const auto ns = static_cast<std::uint64_t>(lateness.count());
  stats_.lateness_sum_ns.fetch_add(ns, std::memory_order_relaxed);
  if (ns > stats_.lateness_max_ns.load(std::memory_order_relaxed)) {
    stats_.lateness_max_ns.store(ns, std::memory_order_relaxed);
  }
}

std::optional<TimePoint> Emulator::next_due() const {
  std::optional<Duration> next;
  for (const Direction& direction : directions_) {
    const auto due = direction.model->next_delivery();
    if (due && (!next || *due < *next)) next = due;
  }
  for (const emu::Cell& cell : bearers_.cells()) {
    const auto due = cell.next_departure();
    if (due && (!next || *due < *next)) next = due;
  }
  if (!next) return std::nullopt;
  return *bearers_.epoch() + *next;
}

// Sleeps until a frame comes, or one is due, or the next tick.
void Emulator::rest() {
  const TimePoint present = now();
  if (present - last_work_ < kDense) return sleep_until(present + kGroup, false);
  const std::optional<TimePoint> due = next_due();
  TimePoint wake = std::max(next_tick_, present);
  if (due) {
    // So close to the next frame run()'s loop goes on without sleeping: it spins.
    if (*due - kSpin <= present) return;
    wake = std::min(wake, *due - kSpin);
  }
  sleep_until(wake, true);
}

void Emulator::sleep_until(TimePoint wake, bool or_frame) {
  const Duration wait = std::max(Duration{}, wake - now());
  const timespec timeout{wait / std::chrono::seconds(1), (wait % std::chrono::seconds(1)).count()};
  const std::size_t skipped = or_frame ? 0 : 1;
  if (::ppoll(fds_.data() + skipped, fds_.size() - skipped, &timeout, nullptr) <= 0) return;
  if (fds_[1].revents != 0 || fds_[2].revents != 0) next_tick_ = {};
}

// The work that belongs to no packet: requests, events, publishing, the ring's losses, the end.
void Emulator::tick(TimePoint present) {
  next_tick_ = present + (bearers_.epoch() ? Bearers::kAdvanceInterval : kHousekeeping);
  bearers_.serve(present);
  bearers_.advance(present);
  pollfd stop = fds_.back();
  if (::poll(&stop, 1, 0) > 0) stopped_ = true;
  if (present < next_housekeeping_) return;
  next_housekeeping_ = present + kHousekeeping;
  const std::uint64_t losses = hub_.take_losses();
  if (losses > 0) stats_.kernel_drops.fetch_add(losses, std::memory_order_relaxed);
  for (Direction& direction : directions_) direction.shared->store(direction.model->stats());
  bearers_.publish_cells(present);
}

}  // namespace interneuron::netns
