// Counts what a test's program takes from the heap, for tests that something allocates nothing or
// holds little. A test that includes this lists tests/counted_heap.cc among its sources, which
// replaces the global operator new of the whole program.
#pragma once

#include <atomic>
#include <cstdint>

namespace interneuron {

// Calls of operator new, in any of its forms, since the program began. Any thread may read it.
extern std::atomic<std::uint64_t> allocations;
// Bytes that it has given and that were not given back. Any thread may read it.
extern std::atomic<std::int64_t> held_bytes;

}  // namespace interneuron
