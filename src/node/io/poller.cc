#include "node/io/poller.h"

#include <sys/eventfd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>

#include "interneuron/transport.h"
#include "node/io/steady_clock.h"

namespace interneuron::io {
namespace {

// ppoll() may end this part of its time too late (select_estimate_accuracy() of Linux,
// fs/select.c).
constexpr int kSlackPart = 1000;
// What that part of it is does not matter: .3 ms. To wait once more costs as much as a dozen
// packets.
constexpr Duration kExact = std::chrono::milliseconds(300);
// Far instants are cut, because a timespec may overflow; to wait once more is harmless.
constexpr Duration kLongest = std::chrono::hours(1);

Duration until_then(TimePoint then) {
  const TimePoint time = now();
  return then <= time ? Duration::zero() : std::min<Duration>(then - time, kLongest);
}

timespec timespec_of(Duration duration) {
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(duration);
  timespec out{};
  out.tv_sec = seconds.count();
  out.tv_nsec = Duration(duration - seconds).count();
  return out;
}

}  // namespace

Poller::Poller() : wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (wake_.get() < 0) {
    const int error = errno;
    throw IoError("cannot wait for sockets (eventfd: " + std::string(std::strerror(error)) + ")",
                  error);
  }
  prepare(For::kWake);
}

void Poller::remove(int handle) {
  std::erase_if(handles_, [handle](const Handle& known) { return known.handle == handle; });
}

void Poller::set_wants_write(int handle, bool wants) {
  const auto known = std::ranges::find(handles_, handle, &Handle::handle);
  if (known != handles_.end()) known->wants_write = wants;
}

void Poller::prepare(For what) {
  waiting_.assign(1, {wake_.get(), POLLIN, 0});
  names_.clear();
  if (what == For::kWake) return;
  for (const Handle& handle : handles_) {
    const int events = handle.wants_write ? POLLIN | POLLOUT : POLLIN;
    waiting_.push_back({handle.handle, static_cast<short>(events), 0});
    names_.push_back(handle.name);
  }
}

std::span<const Poller::Ready> Poller::wait(TimePoint until) {
  ready_.clear();
  int count = 0;
  for (bool is_last = false; count == 0 && !is_last;) {
    const Duration left = until_then(until);
    is_last = left <= kExact;
    const timespec time = timespec_of(is_last ? left : left - left / kSlackPart);
    count = ::ppoll(waiting_.data(), waiting_.size(), &time, nullptr);
  }
  if (count <= 0) return ready_;
  if (waiting_.front().revents != 0) {
    std::uint64_t calls = 0;
    // Cannot fail: it is readable, and nobody else reads it.
    [[maybe_unused]] const auto size = ::read(wake_.get(), &calls, sizeof calls);
  }
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const int events = waiting_[i + 1].revents;
    if (events == 0) continue;
    const bool readable = (events & (POLLIN | POLLERR | POLLHUP)) != 0;
    ready_.push_back({names_[i], readable, (events & POLLOUT) != 0});
  }
  return ready_;
}

void Poller::wake() {
  const std::uint64_t one = 1;
  // Fails only where 2^64 - 2 calls wait already.
  [[maybe_unused]] const auto size = ::write(wake_.get(), &one, sizeof one);
}

}  // namespace interneuron::io
