#include "lab/eval_testbed/testbed_run.h"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "node/io/steady_clock.h"

namespace interneuron::eval_testbed {
namespace {

// How soon a full socket is tried again. A packet of 1,500 bytes leaves a link of 60 Mbit/s in this
// time.
constexpr Duration kRetry = std::chrono::microseconds(200);

}  // namespace

DelayedTransport::DelayedTransport(std::unique_ptr<Transport> inner,
                                   std::function<Duration(const Outgoing&)> delay_of)
    : inner_(std::move(inner)),
      delay_of_(std::move(delay_of)),
      thread_([this](const std::stop_token& stop) { send_waiting(stop); }) {}

BatchResult DelayedTransport::send(std::span<const Outgoing> batch) {
  std::vector<Duration> delays;
  for (const Outgoing& datagram : batch) delays.push_back(delay_of_(datagram));
  const std::scoped_lock lock(mutex_);
  if (gone_ != 0) return {batch.size(), false, gone_};
  const bool none = std::ranges::all_of(delays, [](Duration d) { return d <= Duration{}; });
  if (waiting_.empty() && none) return inner_->send(batch);
  TimePoint due = waiting_.empty() ? TimePoint::min() : waiting_.back().due;
  const TimePoint now = io::now();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    due = std::max(due, now + delays[i]);
    waiting_.push_back({due, batch[i].to, batch[i].joined(), batch[i].ecn});
  }
  wake_.notify_one();
  return {batch.size(), false, 0};
}

void DelayedTransport::send_waiting(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    if (waiting_.empty()) {
      wake_.wait(lock, stop, [this] { return !waiting_.empty(); });
      continue;
    }
    const TimePoint now = io::now();
    if (waiting_.front().due <= now) send_due(now);
    if (waiting_.empty()) continue;
    const TimePoint next = blocked_ ? now + kRetry : waiting_.front().due;
    wake_.wait_until(lock, stop, std::chrono::steady_clock::time_point(next.time_since_epoch()),
                     [] { return false; });
  }
}

void DelayedTransport::send_due(TimePoint now) {
  std::vector<Outgoing> batch;
  for (const Waiting& w : waiting_) {
    if (w.due > now) break;
    batch.push_back({.to = w.to, .head = w.bytes, .ecn = w.ecn});
  }
  const BatchResult result = inner_->send(batch);
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(result.taken));
  blocked_ = result.would_block || result.refused;
  gone_ = result.gone;
  if (gone_ != 0) waiting_.clear();
}

std::span<const Incoming> DelayedTransport::receive() {
  const std::scoped_lock lock(mutex_);
  return inner_->receive();
}

bool DelayedTransport::drained() const {
  const std::scoped_lock lock(mutex_);
  return inner_->drained();
}

TransportCaps DelayedTransport::capabilities() const {
  const std::scoped_lock lock(mutex_);
  return inner_->capabilities();
}

TransportCounters DelayedTransport::counters() const {
  const std::scoped_lock lock(mutex_);
  return inner_->counters();
}

Address DelayedTransport::local_address() const {
  const std::scoped_lock lock(mutex_);
  return inner_->local_address();
}

int DelayedTransport::native_handle() const {
  const std::scoped_lock lock(mutex_);
  return inner_->native_handle();
}

}  // namespace interneuron::eval_testbed
