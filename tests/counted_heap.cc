#include "tests/counted_heap.h"

#include <malloc.h>

#include <cstdlib>
#include <new>

std::atomic<std::uint64_t> interneuron::allocations{0};
std::atomic<std::int64_t> interneuron::held_bytes{0};

namespace {

void* counted(std::size_t size) noexcept {
  interneuron::allocations.fetch_add(1, std::memory_order_relaxed);
  void* p = std::malloc(size == 0 ? 1 : size);
  interneuron::held_bytes.fetch_add(static_cast<std::int64_t>(::malloc_usable_size(p)),
                                    std::memory_order_relaxed);
  return p;
}

void give_back(void* p) noexcept {
  interneuron::held_bytes.fetch_sub(static_cast<std::int64_t>(::malloc_usable_size(p)),
                                    std::memory_order_relaxed);
  std::free(p);
}

void* counted_or_throw(std::size_t size) {
  if (void* p = counted(size)) return p;
  throw std::bad_alloc();
}

}  // namespace

[[gnu::noinline]] void* operator new(std::size_t size) { return counted_or_throw(size); }
[[gnu::noinline]] void* operator new[](std::size_t size) { return counted_or_throw(size); }
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return counted(size);
}
[[gnu::noinline]] void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return counted(size);
}
[[gnu::noinline]] void operator delete(void* p) noexcept { give_back(p); }
[[gnu::noinline]] void operator delete[](void* p) noexcept { give_back(p); }
[[gnu::noinline]] void operator delete(void* p, const std::nothrow_t&) noexcept { give_back(p); }
[[gnu::noinline]] void operator delete[](void* p, const std::nothrow_t&) noexcept { give_back(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { give_back(p); }
[[gnu::noinline]] void operator delete[](void* p, std::size_t) noexcept { give_back(p); }
