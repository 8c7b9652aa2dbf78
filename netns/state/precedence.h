// What a thread asks of the kernel's scheduler in order to wake up on time.
#pragma once

namespace interneuron::netns {

// From now on the calling thread's timers end on time (the kernel's default adds 50 us to each) and
// it runs before ordinary processes (SCHED_FIFO). Where the right to that is missing it asks for a
// short time slice, which kernels from 6.12 on take as a wish for low latency. Without either the
// thread may be late; nothing is reported, as the emulator measures its lateness itself.
void take_precedence();

}  // namespace interneuron::netns
