// A transport that sends some datagrams later: how experiments on the testbed inject delays into
// the real programs. Links stay in order, as in sim::World::delay_with(): what follows a delayed
// datagram on the same link waits for it.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "interneuron/transport.h"

namespace interneuron::cli::eval {

// Thread-compatible; a thread of its own sends what waits. Holds what is delayed without a bound:
// the sender's pacing and the deadline bound it.
class DelayedTransport final : public Transport {
 public:
  // `delay_of` is asked by send(), on its caller's thread, again for what send() did not take.
  DelayedTransport(std::unique_ptr<Transport> inner, std::function<Duration(ByteView)> delay_of);

  SendResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
  TransportCaps capabilities() const override;
  TransportCounters counters() const override;
  Address local_address() const override;
  int native_handle() const override;

 private:
  struct Waiting {
    TimePoint due{};
    Address to{};
    Bytes bytes;
  };
  void send_waiting(const std::stop_token& stop);
  void send_due(TimePoint now);

  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  std::unique_ptr<Transport> inner_;  // guarded by mutex_, as all below
  std::function<Duration(ByteView)> delay_of_;
  std::deque<Waiting> waiting_;  // `due` grows
  bool blocked_ = false;
  int gone_ = 0;
  std::jthread thread_;  // last: it ends first
};

}  // namespace interneuron::cli::eval
