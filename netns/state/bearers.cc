#include "netns/state/bearers.h"

#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

#include "netns/state/check.h"

namespace interneuron::netns {

namespace {

std::uint32_t clamp32(double value) {
  return static_cast<std::uint32_t>(std::clamp(value, 0.0, 4'294'967'295.0));
}

std::uint32_t ppm(double fraction) { return clamp32(fraction * 1e6); }

std::uint32_t kbit(DataRate rate) {
  return clamp32(static_cast<double>(rate.bits_per_second) / 1e3);
}

// The loss that the schedule shows: of a Gilbert-Elliott chain its mean in the long run.
double mean_loss(const emu::Conditions& c) {
  if (!c.gilbert_elliott) return c.loss;
  const emu::GilbertElliott& ge = *c.gilbert_elliott;
  const double bad = ge.p + ge.r > 0 ? ge.p / (ge.p + ge.r) : 0;
  const double burst = (1 - bad) * ge.loss_in_good + bad * ge.loss_in_bad;
  return 1 - (1 - c.loss) * (1 - burst);
}

// The scenario of another vehicle: the same links and events with seeds of its own.
emu::Scenario scenario_of_vehicle(const emu::Scenario& first, std::size_t vehicle) {
  if (vehicle == 0) return first;
  emu::Scenario out = first;
  out.seed = emu::link_seed(first.seed, kMaxLinks + vehicle);
  for (emu::ScenarioLink& link : out.links) link.seed = emu::link_seed(link.seed, vehicle);
  return out;
}

}  // namespace

Bearers::Bearers(const TestbedOptions& options, Backend backend, ControlServer& control,
                 SharedStats& stats)
    : backend_(backend),
      control_(control),
      attention_(check(::epoll_create1(EPOLL_CLOEXEC), "make an epoll")),
      stats_(stats) {
  attend(control_.fd(), [this] {
    if (const auto request = control_.receive())
      control_.reply(carry_out(*request, since_epoch(now_)));
  });
  for (const emu::ScenarioCell& cell : options.scenario.cells) {
    cells_.emplace_back(cell.up);
    cells_.emplace_back(cell.down);
  }
  stats_.cells = cells_.size();
  for (std::size_t v = 0; v < options.vehicles; ++v) {
    vehicles_.push_back(
        std::make_unique<emu::ScenarioPlayer>(scenario_of_vehicle(options.scenario, v)));
    emu::ScenarioPlayer& player = *vehicles_.back();
    for (std::size_t i = 0; i < player.size(); ++i) links_.push_back(&player.link(i));
  }
}

emu::Cell* Bearers::cell(std::size_t index, emu::Direction direction) {
  const std::vector<emu::ScenarioLink>& links = vehicles_.front()->scenario().links;
  const std::optional<std::size_t> cell = links[index % links.size()].cell;
  return cell ? &cells_[emu::kDirections * *cell + static_cast<std::size_t>(direction)] : nullptr;
}

void Bearers::publish_cells(TimePoint now) {
  // The queue of an idle cell is known up to its newest packet.
  const Duration time = since_epoch(now);
  for (std::size_t i = 0; i < cells_.size(); ++i) {
    const emu::CellStats& stats = cells_[i].stats();
    const emu::QueueTime& queue = cells_[i].queue_time();
    SharedCell& out = stats_.cell[i];
    const auto store = [](auto& to, auto value) { to.store(value, std::memory_order_relaxed); };
    store(out.packets_in, stats.packets_in);
    store(out.bytes_delivered, stats.bytes_delivered);
    store(out.dropped, stats.queue_drops + stats.codel_drops + stats.too_big);
    store(out.marked, stats.marked);
    store(out.queue_p99_ns, queue.quantile(0.99).count());
    store(out.queue_mean_ns, queue.mean().count());
    store(out.utilisation, cells_[i].utilisation(time));
  }
}

void Bearers::start(TimePoint epoch) {
  epoch_ = epoch;
  stats_.epoch_ns.store(epoch.time_since_epoch().count(), std::memory_order_relaxed);
}

Duration Bearers::since_epoch(TimePoint now) const {
  return epoch_ ? std::max(Duration{}, now - *epoch_) : Duration{};
}

void Bearers::advance(TimePoint now) {
  if (!epoch_) return;
  const Duration time = since_epoch(now);
  for (const auto& vehicle : vehicles_) vehicle->play(time);
  const std::int64_t due = time / emu::kDelayStep + 1;
  // After a long sleep (a suspended machine) only as many steps are published as the ring holds.
  steps_ = std::max(steps_, due - static_cast<std::int64_t>(SharedLink::kSteps));
  for (; steps_ < due; ++steps_) {
    for (std::size_t i = 0; i < links_.size(); ++i) publish(i, steps_);
  }
}

// Writes one step of one link's schedule to shared memory; the step counts once all of it is there.
void Bearers::publish(std::size_t index, std::int64_t step) {
  const Duration at = step * emu::kDelayStep;
  const emu::Conditions up = link(index).conditions(emu::Direction::kUp, at);
  const emu::Conditions down = link(index).conditions(emu::Direction::kDown, at);
  SharedLink& out = shared(index);
  out.carrier_up.store(link(index).up().params());
  out.carrier_down.store(link(index).down().params());
  SharedSample& sample = out.samples[static_cast<std::size_t>(step) % SharedLink::kSteps];
  const auto rtt_us = std::chrono::duration<double, std::micro>(up.one_way + down.one_way).count();
  sample.rtt_us.store(clamp32(rtt_us), std::memory_order_relaxed);
  sample.loss_up_ppm.store(ppm(mean_loss(up)), std::memory_order_relaxed);
  sample.loss_down_ppm.store(ppm(mean_loss(down)), std::memory_order_relaxed);
  sample.rate_up_kbit.store(kbit(up.rate), std::memory_order_relaxed);
  sample.rate_down_kbit.store(kbit(down.rate), std::memory_order_relaxed);
  out.steps.store(step + 1, std::memory_order_release);
}

void Bearers::attend(int fd, std::function<void()> serve) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = attended_.size();
  check(::epoll_ctl(attention_.get(), EPOLL_CTL_ADD, fd, &event), "watch a file descriptor");
  attended_.push_back(std::move(serve));
}

void Bearers::serve(TimePoint now) {
  now_ = now;
  std::array<epoll_event, 4> events{};
  const int count = ::epoll_wait(attention_.get(), events.data(), events.size(), 0);
  for (int i = 0; i < count; ++i) attended_[events[static_cast<std::size_t>(i)].data.u64]();
}

// Carries out a request. Returns an empty text, or what is wrong with it; then nothing has changed.
std::string Bearers::carry_out(const Request& request, Duration time) {
  const auto known = [this](std::size_t i) { return i < links_.size(); };
  if (!std::all_of(request.links.begin(), request.links.end(), known)) return "no such link";
  emu::LinkChange change;
  if (!request.settings.empty()) {
    auto parsed = emu::parse_change(request.settings, profile_resolver("/"));
    if (const auto* error = std::get_if<emu::ProfileError>(&parsed)) return error->what;
    change = std::get<emu::LinkChange>(std::move(parsed));
    const auto missing = emu::netem_cannot(change);
    if (backend_ == Backend::kNetem && !missing.empty()) {
      return "tc-netem cannot do this: " + missing.front() +
             "; a testbed with --backend emulator can";
    }
  }
  for (const std::size_t i : request.links) {
    if (!request.settings.empty()) link(i).change(time, change);
    if (request.outage > Duration{}) link(i).outage(time, request.outage);
  }
  if (request.measure_cells) {
    for (emu::Cell& cell : cells_) cell.measure_from(time);
  }
  return "";
}

}  // namespace interneuron::netns
