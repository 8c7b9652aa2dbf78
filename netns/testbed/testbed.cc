#include "netns/testbed/testbed.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <utility>

#include "netns/holder/holder.h"
#include "netns/state/check.h"
#include "netns/state/control.h"
#include "netns/state/shared_stats.h"
#include "netns/state/state_file.h"
#include "netns/wiring/nic_plan.h"
#include "node/io/file_descriptor.h"

namespace interneuron::netns {

namespace {

// Between SIGTERM and SIGKILL: longer than the holder's loop, which looks at its signals every
// 10 ms, and the removal of its state file take.
constexpr int kGraceMs = 2000;
// After SIGKILL the kernel takes away the holder's sockets, which needs tens of milliseconds. No
// measurement is behind this value: it only has to be longer than that on a loaded machine.
constexpr int kKillBoundMs = 5000;
// "if" and the name must fit into IFNAMSIZ - 1 = 15 characters.
constexpr std::size_t kMaxLinkName = 13;

void check_options(const TestbedOptions& options) {
  check_name(options.name, 64, "the name of a testbed");
  if (options.vehicles < 1 || options.vehicles > kMaxVehicles) {
    throw TestbedError(2, "a testbed has 1 to " + std::to_string(kMaxVehicles) + " vehicles, not " +
                              std::to_string(options.vehicles));
  }
  if (options.roads < 1 || options.roads > kMaxRoads) {
    throw TestbedError(2, "a testbed has 1 to " + std::to_string(kMaxRoads) +
                              " roadside units, not " + std::to_string(options.roads));
  }
  const auto& links = options.scenario.links;
  if (links.empty() || links.size() > kMaxLinks) {
    throw TestbedError(2, "a vehicle has 1 to " + std::to_string(kMaxLinks) + " links, not " +
                              std::to_string(links.size()));
  }
  std::set<std::string> names;
  for (const emu::ScenarioLink& link : links) {
    check_name(link.name, kMaxLinkName, "the name of a link");
    if (!names.insert(link.name).second) {
      throw TestbedError(2, "two links are called '" + link.name + "'; name one NAME=PROFILE");
    }
  }
}

// Whether there is anything of this name, be it a symbolic link to nothing. If the look fails,
// opening the directory throws with the reason.
bool is_there(const std::filesystem::path& runtime_dir) {
  std::error_code error;
  return std::filesystem::symlink_status(runtime_dir, error).type() !=
         std::filesystem::file_type::not_found;
}

// find() for a caller that holds the lock.
std::optional<State> find_locked(const std::filesystem::path& file) {
  const std::optional<State> state = read_state(file);
  if (!state) return std::nullopt;
  if (holder_alive(*state)) return state;
  // The file of another user cannot be removed; that user's next call removes it.
  std::error_code ignored;
  std::filesystem::remove(file, ignored);
  return std::nullopt;
}

// Removes the state files of holders that have ended without doing so, because they were killed;
// for a caller that holds the lock. Files that are no state files of this version stay.
void remove_dead(const std::filesystem::path& runtime_dir) {
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(runtime_dir, ignored)) {
    if (entry.path().extension() != ".json") continue;
    try {
      find_locked(entry.path());
    } catch (const TestbedError&) {
      continue;
    }
  }
}

// True when the process has ended within the bound.
bool await_end(int pidfd, int bound_ms) {
  pollfd ended{pidfd, POLLIN, 0};
  return ::poll(&ended, 1, bound_ms) > 0;
}

void send_signal(int pidfd, int signal, const State& state) {
  if (::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0) == 0 || errno == ESRCH) return;
  if (errno == EPERM) {
    throw TestbedError(
        5, "testbed '" + state.name + "' belongs to another user; become that user or root");
  }
  fail_errno("end testbed '" + state.name + "'");
}

void end_holder(const State& state) {
  const io::FileDescriptor pidfd(static_cast<int>(::syscall(SYS_pidfd_open, state.holder, 0)));
  // The process number may have been given to another process before the pidfd was opened. From
  // now on it cannot, so this look decides.
  if (pidfd.get() >= 0 && holder_alive(state)) {
    send_signal(pidfd.get(), SIGTERM, state);
    if (!await_end(pidfd.get(), kGraceMs)) {
      send_signal(pidfd.get(), SIGKILL, state);
      if (!await_end(pidfd.get(), kKillBoundMs)) {
        throw TestbedError(1, "testbed '" + state.name + "' (pid " + std::to_string(state.holder) +
                                  ") does not end");
      }
    }
  }
  // Reaps the holder where it is our child; otherwise the call returns an error at once.
  ::waitpid(state.holder, nullptr, WNOHANG);
}

// The holder's shared counters, mapped read-only while this lives. Throws TestbedError when the
// testbed has gone (1), is another user's (5), or was made by another version of the program, whose
// layout differs (1). The size is checked before the memory is read, so that a shorter file cannot
// end the reader with SIGBUS.
class StatsView {
 public:
  explicit StatsView(const State& state) {
    const std::string path =
        "/proc/" + std::to_string(state.holder) + "/fd/" + std::to_string(state.stats_fd);
    const io::FileDescriptor fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (fd.get() < 0 && errno == EACCES) {
      throw TestbedError(
          5, "testbed '" + state.name + "' belongs to another user; become that user or root");
    }
    if (fd.get() < 0 || !holder_alive(state)) {
      throw TestbedError(1, "testbed '" + state.name + "' is not up any more");
    }
    bytes_ = SharedStats::bytes(state.links.size());
    if (::lseek(fd.get(), 0, SEEK_END) != static_cast<off_t>(bytes_)) fail_version(state);
    memory_ = ::mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, fd.get(), 0);
    if (memory_ == MAP_FAILED) fail_errno("map the counters of testbed '" + state.name + "'");
    if (stats().version != SharedStats::kVersion) fail_version(state);
  }
  ~StatsView() { ::munmap(memory_, bytes_); }
  StatsView(const StatsView&) = delete;
  StatsView& operator=(const StatsView&) = delete;

  const SharedStats& stats() const { return *static_cast<const SharedStats*>(memory_); }

 private:
  [[noreturn]] static void fail_version(const State& state) {
    throw TestbedError(
        1, "testbed '" + state.name +
               "' was made by another version of this program; take it down and up again");
  }

  void* memory_ = nullptr;
  std::size_t bytes_ = 0;
};

CellDirection read(const SharedCell& cell) {
  constexpr auto kRelaxed = std::memory_order_relaxed;
  return {cell.packets_in.load(kRelaxed),
          cell.bytes_delivered.load(kRelaxed),
          cell.dropped.load(kRelaxed),
          cell.marked.load(kRelaxed),
          Duration{cell.queue_p99_ns.load(kRelaxed)},
          Duration{cell.queue_mean_ns.load(kRelaxed)},
          cell.utilisation.load(kRelaxed)};
}

// "5g", "vehicle2/5g", "*", "vehicle2/*".
bool matches(const TestbedLink& link, const std::string& which) {
  const std::size_t slash = which.find('/');
  if (slash != std::string::npos &&
      parse_host(which.substr(0, slash)) != Host{Host::Kind::kVehicle, link.vehicle}) {
    return false;
  }
  const std::string name = slash == std::string::npos ? which : which.substr(slash + 1);
  return name == "*" || name == link.name;
}

}  // namespace

std::filesystem::path default_runtime_dir() {
  std::error_code ignored;
  const char* xdg = std::getenv("XDG_RUNTIME_DIR");
  if (xdg != nullptr && *xdg == '/' && std::filesystem::is_directory(xdg, ignored)) {
    return std::filesystem::path(xdg) / "interneuron";
  }
  if (::geteuid() == 0) return "/run/interneuron";
  return "/tmp/interneuron-" + std::to_string(::geteuid());
}

Testbed Testbed::up(const TestbedOptions& options) {
  check_options(options);
  State state;
  state.name = options.name;
  state.detached = options.detached;
  state.seed = options.scenario.seed;
  state.file = std::filesystem::absolute(state_path(options.runtime_dir, options.name));
  state.nat = options.nat;
  state.links = plan_links(options);
  make_runtime_dir(options.runtime_dir);
  const RuntimeDirLock lock(options.runtime_dir);
  remove_dead(options.runtime_dir);
  if (const auto present = find_locked(state.file)) {
    throw TestbedError(1, "testbed '" + options.name + "' is already up (pid " +
                              std::to_string(present->holder) +
                              "); `interneuron testbed down --name " + options.name + "` ends it");
  }
  start_holder(options, state);
  return Testbed(std::move(state));
}

std::optional<State> Testbed::find(const std::string& name,
                                   const std::filesystem::path& runtime_dir) {
  const std::filesystem::path file = std::filesystem::absolute(state_path(runtime_dir, name));
  if (!is_there(runtime_dir)) return std::nullopt;
  const RuntimeDirLock lock(runtime_dir);
  remove_dead(runtime_dir);
  return find_locked(file);
}

std::vector<State> Testbed::list(const std::filesystem::path& runtime_dir) {
  std::vector<State> out;
  std::error_code ignored;
  if (!is_there(runtime_dir)) return out;
  const RuntimeDirLock lock(runtime_dir);
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(runtime_dir, ignored)) {
    if (entry.path().extension() == ".json")
      files.push_back(std::filesystem::absolute(entry.path()));
  }
  std::sort(files.begin(), files.end());
  for (const auto& file : files) {
    if (auto state = find_locked(file)) out.push_back(std::move(*state));
  }
  return out;
}

void Testbed::down(const State& state) {
  end_holder(state);
  if (!is_there(state.file.parent_path())) return;
  const RuntimeDirLock lock(state.file.parent_path());
  // Removes the file, unless a new testbed has taken the name in the meantime.
  find_locked(state.file);
}

Snapshot Testbed::snapshot(const State& state) {
  const StatsView view(state);
  const SharedStats& stats = view.stats();
  Snapshot out;
  const std::int64_t epoch_ns = stats.epoch_ns.load(std::memory_order_relaxed);
  if (epoch_ns != 0) out.epoch = TimePoint{Duration{epoch_ns}};
  for (std::size_t i = 0; i < state.links.size(); ++i) {
    out.links.push_back({state.links[i].name, state.links[i].vehicle, stats.link(i).up.load(),
                         stats.link(i).down.load()});
  }
  for (std::size_t i = 0; i < stats.cells; i += emu::kDirections) {
    out.cells.push_back({read(stats.cell[i]), read(stats.cell[i + 1])});
  }
  out.frames_sent = stats.frames_sent.load(std::memory_order_relaxed);
  out.kernel_drops = stats.kernel_drops.load(std::memory_order_relaxed);
  out.netem_skipped = stats.netem_skipped.load(std::memory_order_relaxed);
  out.netem_put_off = stats.netem_put_off.load(std::memory_order_relaxed);
  out.netem_failed = stats.netem_failed.load(std::memory_order_relaxed);
  const auto sum_ns = static_cast<double>(stats.lateness_sum_ns.load(std::memory_order_relaxed));
  if (out.frames_sent > 0)
    out.lateness_mean_us = sum_ns / 1e3 / static_cast<double>(out.frames_sent);
  out.lateness_max_us =
      static_cast<double>(stats.lateness_max_ns.load(std::memory_order_relaxed)) / 1e3;
  return out;
}

std::vector<ScheduleSample> Testbed::schedule(const State& state, std::size_t index, Duration from,
                                              Duration to) {
  const StatsView view(state);
  const SharedLink& link = view.stats().link(index);
  const std::int64_t made = link.steps.load(std::memory_order_acquire);
  constexpr auto kKept = static_cast<std::int64_t>(SharedLink::kSteps);
  // The oldest samples may be overwritten while they are read: 100 steps are left out, which the
  // holder writes in one second.
  constexpr std::int64_t kMargin = 100;
  const std::int64_t first =
      std::max<std::int64_t>(from / emu::kDelayStep, made > kKept ? made - kKept + kMargin : 0);
  const std::int64_t last = std::min<std::int64_t>(to / emu::kDelayStep, made - 1);
  const auto fraction = [](const std::atomic<std::uint32_t>& ppm) {
    return static_cast<double>(ppm.load(std::memory_order_relaxed)) / 1e6;
  };
  const auto rate = [](const std::atomic<std::uint32_t>& kbit) {
    return DataRate{std::int64_t{kbit.load(std::memory_order_relaxed)} * 1000};
  };
  std::vector<ScheduleSample> out;
  for (std::int64_t step = first; step <= last; ++step) {
    const SharedSample& s = link.samples[static_cast<std::size_t>(step % kKept)];
    out.push_back({step * emu::kDelayStep,
                   std::chrono::microseconds(s.rtt_us.load(std::memory_order_relaxed)),
                   fraction(s.loss_up_ppm), fraction(s.loss_down_ppm), rate(s.rate_up_kbit),
                   rate(s.rate_down_kbit)});
  }
  return out;
}

emu::DirectionParams Testbed::carrier(const State& state, std::size_t index,
                                      emu::Direction direction) {
  const StatsView view(state);
  const SharedLink& link = view.stats().link(index);
  return (direction == emu::Direction::kUp ? link.carrier_up : link.carrier_down).load();
}

std::vector<std::size_t> Testbed::select(const State& state, const std::string& which) {
  std::vector<std::size_t> out;
  std::string known;
  for (std::size_t i = 0; i < state.links.size(); ++i) {
    if (matches(state.links[i], which)) out.push_back(i);
    if (state.links[i].vehicle == 0) known += ", " + state.links[i].name;
  }
  if (!out.empty()) return out;
  throw TestbedError(2, "testbed '" + state.name + "' has no link '" + which + "'; there are *" +
                            known + ", also of one vehicle: vehicle1/" + state.links.front().name);
}

void Testbed::change(const State& state, const std::string& which,
                     const std::vector<std::string>& settings) {
  Request request;
  request.links = select(state, which);
  for (std::string setting : settings) {
    // The holder's working directory is another one, so it gets an absolute path.
    constexpr std::string_view kProfile = "profile=";
    if (setting.starts_with(kProfile) && setting.find('/') != std::string::npos) {
      setting = std::string(kProfile) +
                std::filesystem::absolute(setting.substr(kProfile.size())).string();
    }
    request.settings.push_back(std::move(setting));
  }
  ask(state, request);
}

void Testbed::outage(const State& state, const std::string& which, Duration length) {
  Request request;
  request.links = select(state, which);
  request.outage = length;
  ask(state, request);
}

void Testbed::measure_cells(const State& state) {
  Request request;
  request.measure_cells = true;
  ask(state, request);
}

Testbed::Testbed(State state)
    : state_(std::move(state)), owner_(state_.detached ? 0 : ::getpid()) {}

Testbed::Testbed(Testbed&& other) noexcept
    : state_(std::move(other.state_)), owner_(std::exchange(other.owner_, 0)) {}

Testbed& Testbed::operator=(Testbed&& other) noexcept {
  std::swap(state_, other.state_);
  std::swap(owner_, other.owner_);
  return *this;
}

Testbed::~Testbed() {
  // In a fork of the owner this is a copy of the owner's object; only the owner ends the testbed.
  if (owner_ == 0 || owner_ != ::getpid()) return;
  try {
    down();
  } catch (const std::exception&) {
    // The holder dies with this process anyway (die_with() of holder.cc).
  }
}

void Testbed::down() {
  owner_ = 0;
  down(state_);
}

}  // namespace interneuron::netns
