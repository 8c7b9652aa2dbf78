#include "netns/state/precedence.h"

#include <sched.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

namespace interneuron::netns {

namespace {

constexpr unsigned long kTimerSlackNs = 1;
// The shortest time slice that the kernel grants.
constexpr std::uint64_t kShortSliceNs = 100'000;
// Under SCHED_FIFO any priority above 0 comes before all ordinary processes.
constexpr int kPriority = 10;

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

}  // namespace

// Before ordinary processes the emulator's lateness is below 20 us on a loaded machine
// (docs/constants.md, "The testbed on a machine").
void take_precedence() {
  ::prctl(PR_SET_TIMERSLACK, kTimerSlackNs);
  sched_param priority{};
  priority.sched_priority = kPriority;
  if (::sched_setscheduler(0, SCHED_FIFO, &priority) == 0) return;
  SchedAttributes attributes{.runtime_ns = kShortSliceNs};
  // Kernels that do not know short slices refuse this; the thread then runs as before.
  ::syscall(SYS_sched_setattr, 0, &attributes, 0);
}

}  // namespace interneuron::netns
