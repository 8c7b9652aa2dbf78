// Counts what a test's program takes from the heap, for tests that something allocates nothing. A
// test that includes this lists tests/counted_heap.cc among its sources, which replaces the global
// operator new of the whole program.
#pragma once

#include <atomic>
#include <cstdint>

namespace interneuron {

// Calls of operator new, in any of its forms, since the program began. Any thread may read it.
extern std::atomic<std::uint64_t> allocations;

}  // namespace interneuron
