#include "netns/emulator.h"

#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>

#include "netns/checksum.h"
#include "netns/wiring.h"

namespace interneuron::netns {

namespace {

constexpr std::size_t kEthernetHeader = 14;
constexpr std::uint16_t kEtherTypeIpv4 = 0x0800;
constexpr std::uint16_t kEtherTypeArp = 0x0806;

// How long before a frame is due the emulator stops sleeping: what a wake-up of an idle virtual CPU
// takes here (testbed.md §2.2: 40 to 60 us).
constexpr Duration kSpin = std::chrono::microseconds(60);
// Spinning is for sparse frames; when they follow closer than this the CPU is awake anyway and
// spinning would only burn it.
constexpr Duration kSparse = std::chrono::microseconds(500);
constexpr Duration kHousekeeping = std::chrono::milliseconds(100);
constexpr std::size_t kTakeInAtOnce =
    256;  // frames, so that those that are due never wait for a flood
constexpr Duration kOldestArrival = std::chrono::seconds(1);
constexpr Duration kTightClocks = std::chrono::microseconds(2);  // three readings take 0.1 us
constexpr int kClockAttempts = 10;
constexpr std::uint64_t kShortSliceNs = 100'000;  // the shortest that the kernel grants
constexpr int kPriority = 10;  // SCHED_FIFO; any above 0 is before all ordinary processes

Duration read_clock(clockid_t clock) {
  timespec t{};
  ::clock_gettime(clock, &t);  // cannot fail: the clocks exist and &t is valid
  return std::chrono::seconds{t.tv_sec} + Duration{t.tv_nsec};
}

TimePoint now() { return TimePoint{read_clock(CLOCK_MONOTONIC)}; }

// CLOCK_REALTIME minus CLOCK_MONOTONIC, read anew each time, because the wall clock may be set at
// any time. Being put off the CPU between two readings would make an error of milliseconds, so it
// is the tightest of a few attempts.
Duration realtime_offset() {
  Duration best{};
  Duration tightest = Duration::max();
  for (int i = 0; i < kClockAttempts && tightest > kTightClocks; ++i) {
    const Duration before = read_clock(CLOCK_MONOTONIC);
    const Duration realtime = read_clock(CLOCK_REALTIME);
    const Duration gap = read_clock(CLOCK_MONOTONIC) - before;
    if (gap >= tightest) continue;
    tightest = gap;
    best = realtime - before - gap / 2;
  }
  return best;
}

std::uint16_t ether_type(std::span<const std::byte> frame) {
  return static_cast<std::uint16_t>(std::to_integer<unsigned>(frame[12]) << 8U |
                                    std::to_integer<unsigned>(frame[13]));
}

// struct sched_attr of linux/sched/types.h, which clashes with <sched.h> of glibc before 2.41.
struct SchedAttributes {
  std::uint32_t size = sizeof(SchedAttributes);
  std::uint32_t policy = SCHED_OTHER;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime_ns = 0;
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};

// Before ordinary processes: keeps the lateness below 20 us on a loaded machine (testbed.md §2.2).
// Without that right, it asks for a short slice of time, which the scheduler of kernels from 6.12
// on takes as a wish for low latency.
void take_precedence() {
  sched_param priority{};
  priority.sched_priority = kPriority;
  if (::sched_setscheduler(0, SCHED_FIFO, &priority) == 0) return;
  SchedAttributes attributes;
  attributes.runtime_ns = kShortSliceNs;
  ::syscall(SYS_sched_setattr, 0, &attributes, 0);  // a wish; refusing it harms nothing
}

}  // namespace

Emulator::Link::Link(const LinkSpec& spec, std::uint64_t seed)
    : vehicle(vehicle_port(spec.name)), road(road_port(spec.name)), model(spec.profile, seed) {}

Emulator::Emulator(const std::vector<LinkSpec>& links, std::uint64_t seed, SharedStats& stats)
    : stats_(stats) {
  for (std::size_t i = 0; i < links.size(); ++i) {
    links_.push_back(std::make_unique<Link>(links[i], emu::link_seed(seed, i)));
    Link& link = *links_.back();
    directions_.push_back({&link.vehicle, &link.road, &link.model.up(), &stats_.up[i]});
    directions_.push_back({&link.road, &link.vehicle, &link.model.down(), &stats_.down[i]});
  }
}

void Emulator::run(int stop_fd) {
  stop_fd_ = stop_fd;
  ::prctl(PR_SET_TIMERSLACK, 1UL);  // ns; the default of 50 us would be added to every delay
  take_precedence();

  while (!stopped_) {
    std::size_t work = 0;
    const Duration offset = realtime_offset();
    for (Direction& direction : directions_) work += take_in(direction, offset);
    for (Direction& direction : directions_) work += send_due(direction);
    if (work == 0) rest();
    if (now() >= next_housekeeping_) keep_house();
  }
}

std::size_t Emulator::take_in(Direction& direction, Duration offset) {
  std::size_t taken = 0;
  while (taken < kTakeInAtOnce) {
    const auto frame = direction.from->receive();
    if (!frame) break;
    ++taken;
    // A step of the wall clock between arrival and now must not become a delay.
    const TimePoint present = now();
    TimePoint arrival{frame->arrival_realtime - offset};
    if (arrival > present || arrival < present - kOldestArrival) arrival = present;
    arrival = std::max(arrival, direction.last_arrival);
    direction.last_arrival = arrival;
    enter(direction, *frame, arrival);
    direction.from->release();
  }
  if (taken > 0) direction.shared->store(direction.model->stats());
  return taken;
}

void Emulator::enter(Direction& direction, const FramePort::Frame& frame, TimePoint arrival) {
  if (frame.bytes.size() <= kEthernetHeader) return;
  const std::uint16_t type = ether_type(frame.bytes);
  if (type != kEtherTypeIpv4 && type != kEtherTypeArp) return;
  if (!epoch_) {
    // Before the drive begins neighbours may be asked for, without delay.
    if (type == kEtherTypeArp) {
      const iovec now_or_never{const_cast<std::byte*>(frame.bytes.data()), frame.bytes.size()};
      direction.to->send({&now_or_never, 1});
      return;
    }
    epoch_ = arrival;
    stats_.epoch_ns.store(arrival.time_since_epoch().count(), std::memory_order_relaxed);
  }
  // Another direction may have seen a packet that arrived a little later first.
  const Duration since_epoch = std::max(Duration{}, arrival - *epoch_);
  const std::size_t ip_bytes = frame.bytes.size() - kEthernetHeader;
  if (!direction.model->enqueue(since_epoch, ip_bytes, 0)) return;
  const std::span<std::byte> stored = direction.store.push(frame.bytes);
  if (frame.checksum_missing) complete_checksum(stored);
}

std::size_t Emulator::send_due(Direction& direction) {
  if (!epoch_) return 0;
  const TimePoint present = now();
  std::size_t count = 0;
  while (count < batch_.size()) {
    const auto packet = direction.model->dequeue(present - *epoch_);
    if (!packet) break;
    const std::span<std::byte> frame = direction.store.at(count);
    batch_[count++] = {frame.data(), frame.size()};
    count_lateness(present - (*epoch_ + packet->due));
  }
  if (count == 0) return 0;
  const std::size_t sent = direction.to->send({batch_.data(), count});
  for (std::size_t i = 0; i < count; ++i) direction.store.pop_oldest();
  stats_.frames_sent.fetch_add(sent, std::memory_order_relaxed);
  stats_.kernel_drops.fetch_add(count - sent, std::memory_order_relaxed);
  direction.shared->store(direction.model->stats());
  last_sent_ = present;
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
  std::optional<TimePoint> next;
  for (const Direction& direction : directions_) {
    const auto due = direction.model->next_delivery();
    if (due && (!next || *epoch_ + *due < *next)) next = *epoch_ + *due;
  }
  return next;
}

// Sleeps until a frame comes, or one is due, or housekeeping.
void Emulator::rest() {
  const std::optional<TimePoint> due = next_due();
  const TimePoint present = now();
  TimePoint wake = std::max(next_housekeeping_, present);
  if (due) {
    const Duration spin = *due - last_sent_ > kSparse ? kSpin : Duration{};
    if (*due - spin <= present) return;  // the caller's loop is the spinning
    wake = std::min(wake, *due - spin);
  }
  const Duration wait = wake - present;
  const timespec timeout{wait / std::chrono::seconds(1), (wait % std::chrono::seconds(1)).count()};
  std::array<pollfd, 2 * kMaxLinks + 1> fds{};
  std::size_t count = 0;
  for (const Direction& direction : directions_) fds[count++] = {direction.from->fd(), POLLIN, 0};
  fds[count++] = {stop_fd_, POLLIN, 0};
  if (::ppoll(fds.data(), count, &timeout, nullptr) <= 0) return;
  if (fds[count - 1].revents != 0) stopped_ = true;
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    if ((fds[i].revents & POLLERR) != 0) directions_[i].from->clear_error();
  }
}

void Emulator::keep_house() {
  const TimePoint present = now();
  next_housekeeping_ = present + kHousekeeping;
  std::uint64_t losses = 0;
  for (const Direction& direction : directions_) losses += direction.from->take_losses();
  if (losses > 0) stats_.kernel_drops.fetch_add(losses, std::memory_order_relaxed);
  // Keeps the delay process near the present, so that a packet after an idle hour need not make an
  // hour of steps first.
  if (epoch_) {
    for (const auto& link : links_) link->model.keep_up(present - *epoch_);
  }
  pollfd stop{stop_fd_, POLLIN, 0};  // a flood would never let rest() look
  if (::poll(&stop, 1, 0) > 0) stopped_ = true;
}

}  // namespace interneuron::netns
