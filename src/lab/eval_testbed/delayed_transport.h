// A transport that sends some datagrams later: how experiments on the testbed inject delays into
// the real programs. Links stay in order, as in sim::World::delay_with(): later datagrams on the
// same link wait for a delayed one.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "interneuron/transport.h"

namespace interneuron::cli {

// Wraps the transport of one link, which it owns. While nothing is delayed it passes everything on
// at once; delayed datagrams are copied and sent by a thread of its own. Their number has no bound
// here: the sender's pacing and the deadline of rounds bound what it hands over. Errors of the
// inner transport end the link as they would without this class. The calls are thread-compatible.
class DelayedTransport final : public Transport {
 public:
  // `delay_of` tells how much later a datagram is sent. It is asked by send(), on its caller's
  // thread, and asked again for datagrams that send() did not take.
  DelayedTransport(std::unique_ptr<Transport> inner,
                   std::function<Duration(const Outgoing&)> delay_of);

  BatchResult send(std::span<const Outgoing> batch) override;
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
    std::uint8_t ecn = 0;
  };
  void send_waiting(const std::stop_token& stop);
  void send_due(TimePoint now);

  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  // Guarded by mutex_, as are waiting_, blocked_ and gone_.
  std::unique_ptr<Transport> inner_;
  std::function<Duration(const Outgoing&)> delay_of_;
  // In the order of `due`.
  std::deque<Waiting> waiting_;
  bool blocked_ = false;
  int gone_ = 0;
  // Declared last, so that it has ended before the others are destroyed.
  std::jthread thread_;
};

}  // namespace interneuron::cli
