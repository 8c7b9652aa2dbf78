#include "node/io/poller.h"

#include <sys/epoll.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string>

#include "interneuron/transport.h"

namespace interneuron::io {
namespace {

// Handles that one poll() names at most; the kernel names others first the next time. No
// measurement behind this value: hosts have a few network cards.
constexpr std::size_t kMostReady = 32;

[[noreturn]] void fail(const char* call) {
  const int error = errno;
  throw IoError("cannot wait for sockets (" + std::string(call) + ": " + std::strerror(error) + ")",
                error);
}

epoll_event event_of(std::uint32_t name, bool wants_write) {
  epoll_event event{};
  event.events = wants_write ? EPOLLIN | EPOLLOUT : EPOLLIN;
  event.data.u32 = name;
  return event;
}

}  // namespace

Poller::Poller() : handle_(::epoll_create1(EPOLL_CLOEXEC)) {
  if (handle_.get() < 0) fail("epoll_create1");
  ready_.reserve(kMostReady);
}

void Poller::add(int handle, std::uint32_t name) {
  epoll_event event = event_of(name, false);
  if (::epoll_ctl(handle_.get(), EPOLL_CTL_ADD, handle, &event) != 0) fail("epoll_ctl");
}

// Neither can fail for a handle that was added.
void Poller::remove(int handle) { ::epoll_ctl(handle_.get(), EPOLL_CTL_DEL, handle, nullptr); }

void Poller::set_wants_write(int handle, std::uint32_t name, bool wants) {
  epoll_event event = event_of(name, wants);
  ::epoll_ctl(handle_.get(), EPOLL_CTL_MOD, handle, &event);
}

std::span<const Poller::Ready> Poller::poll() {
  ready_.clear();
  std::array<epoll_event, kMostReady> events;
  const int count = ::epoll_wait(handle_.get(), events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    const bool readable = (event.events & (EPOLLIN | EPOLLERR | EPOLLHUP)) != 0;
    ready_.push_back({event.data.u32, readable, (event.events & EPOLLOUT) != 0});
  }
  return ready_;
}

}  // namespace interneuron::io
