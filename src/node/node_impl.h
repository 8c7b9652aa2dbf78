// The loop of a Node. Everything runs on the loop thread, except post(), stop() and the jobs of the
// workers.
//
// One turn: what may leave leaves, what happened is told to the application, time-outs that are due
// are handled, until nothing is left to do; then the one timer is armed. Each way into the loop (a
// readable or writable socket, the timer, a task) does its own thing and ends with a turn.
#pragma once

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/node.h"
#include "node/outbox.h"
#include "node/workers.h"

namespace interneuron {

class Node::Impl : private Outbox::Source {
 public:
  explicit Impl(NodeOptions options);
  ~Impl() override;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  struct Handlers {
    std::function<void(Delivered)> delivered;
    std::function<void(RoundDone)> round_done;
    std::function<void(PeerReady)> peer_ready;
    std::function<void(PeerRestarted)> peer_restarted;
    std::function<void(PeerLost)> peer_lost;
    std::function<void(Planned)> planned;
    std::function<void(LinkId, std::string_view)> link_lost;
  };

  void run();
  void stop() { context_.stop(); }
  void stop_on_signals();
  void at(TimePoint time, Task task);
  void compute(Queue queue, Job job);
  void post(Task task);

  struct Link {
    NodeLink options;
    std::unique_ptr<Transport> transport;  // empty once the NIC is gone
    std::optional<boost::asio::posix::stream_descriptor> watcher;
    bool waits_for_write = false;
  };
  const Link* find(LinkId link) const;

  Handlers handlers;
  Endpoint& endpoint() { return endpoint_; }
  const Outbox& outbox() const { return outbox_; }
  SessionId session() const { return session_; }
  std::optional<PeerId> peer() const { return peer_; }
  int signal() const { return signal_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::optional<Transmit> poll(TimePoint now, std::span<std::byte> buffer) override;

  Impl(NodeOptions&& options, const EndpointOptions& endpoint);
  void open(const NodeOptions& options, const NodeLink& link);
  void connect(const NodeOptions& options);
  void shut_down();

  // --- ways into the loop
  void wait_readable(Link& link);
  void wait_writable(Link& link);
  void on_readable(Link& link);
  void on_timer();
  void enter(const Task& task);

  // --- a turn
  void turn();
  Outbox::More settle();
  void receive(Link& link);
  bool tell_events();
  void tell(Event&& event);
  bool handle_due();
  bool lose_gone_links();
  void arm(Outbox::More more);

  boost::asio::io_context context_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  boost::asio::steady_timer timer_;
  std::optional<TimePoint> armed_;  // when the timer will fire
  boost::asio::signal_set signals_;
  std::atomic<int> signal_{0};
  SessionId session_;
  Endpoint endpoint_;
  std::optional<PeerId> peer_;
  std::vector<std::unique_ptr<Link>> links_;  // their addresses are captured by waits
  Outbox outbox_;
  bool turn_posted_ = false;
  bool ran_ = false;
  std::vector<std::string> warnings_;
  // Last, so that they end first.
  Workers computation_;
  Workers backup_;
};

}  // namespace interneuron
