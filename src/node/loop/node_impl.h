// The loop of a Node. Everything runs on the loop thread, except post(), stop() and the jobs of the
// workers.
//
// One turn: what may leave leaves, what happened is told to the application, time-outs that are due
// are handled, until nothing is left to do; then the one timer is armed. Each way into the loop
// (sockets that are ready, the timer, a task) does its own thing and ends with a turn.
#pragma once

#include <algorithm>
#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "interneuron/endpoint.h"
#include "interneuron/node.h"
#include "node/io/poller.h"
#include "node/io/steady_clock.h"
#include "node/loop/link_set.h"
#include "node/loop/outbox.h"

namespace interneuron {

// A queue of jobs and the threads that run them, in the order in which the jobs came. The queue is
// not bounded.
//
// submit() and stop() belong to one thread, the loop thread of a Node. Jobs run on the workers'
// threads and must not throw: an exception would end the process. Owns its threads. The constructor
// throws std::system_error when a thread cannot be started.
class Workers {
 public:
  explicit Workers(std::size_t threads);
  ~Workers() { stop(); }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  // Ignored after stop().
  void submit(std::function<void()> job);
  // Drops the jobs that wait, waits for those that run.
  void stop();

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable wake_;
  // mutex_ guards both.
  std::deque<std::function<void()>> jobs_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

class Node::Impl : private Outbox::Source, private LinkSet::User {
 public:
  class Shards;
  class Whole;

  explicit Impl(NodeOptions options);
  // One of several shards, which the front looks after.
  Impl(const EndpointOptions& endpoint, Shards& crew);
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
    std::function<void(PathChanged)> path_changed;
    std::function<void(OtherVersion)> other_version;
    std::function<void(PeerLimited)> peer_limited;
    std::function<void(RevocationsChanged)> revocations_changed;
    std::function<void(KeyShared)> key_shared;
    std::function<void(Message)> message;
    std::function<void(MessageFate)> fate;
    std::function<void(CanSend)> can_send;
    std::function<void(NicChanged)> nic_changed;
    std::function<void(const Statistics&)> statistics;
    Duration statistics_interval{};
  };

  void run();
  void stop() { context_.stop(); }
  void stop_on_signals();
  void at(TimePoint time, Task task);
  void compute(Queue queue, Job job);
  void post(Task task);

  PeerId connect(std::span<const std::pair<LinkId, Address>> addresses,
                 const std::optional<PublicKey>& key);
  const LinkSet& links() const { return links_; }

  Handlers handlers;
  Endpoint& endpoint() { return endpoint_; }
  SessionId session() const { return session_; }
  std::optional<PeerId> peer() const { return peer_; }
  int signal() const { return signal_; }

 private:
  // The socket of one incarnation of a link, as the loop waits for it.
  struct Port {
    LinkId link{};
    Transport* transport = nullptr;
    bool waits_for_write = false;
  };

  std::optional<TransmitParts> poll(TimePoint now, std::span<std::byte> buffer) override;

  Impl(NodeOptions&& options, const EndpointOptions& endpoint);
  void connect();
  void shut_down();

  // --- links come and go
  void link_opened(LinkSet::Link& link) override;
  void link_closing(LinkSet::Link& link) override;
  void nic_changed(const NicChanged& change) override;
  void open_port(LinkId id, Transport& transport, const LinkInfo& info);
  void close_port(LinkId id);
  void check_nics();

  // --- ways into the loop
  void wait_for_nics();
  void wait_for_sockets();
  void on_timer();
  void repeat_statistics(TimePoint due);
  void repeat_clock();
  void run_task(const Task& task);
  // Runs what belongs to the application and notes how long it kept the loop.
  template <class Work>
  void run_work(const Work& work) {
    const TimePoint began = io::now();
    work();
    loop_stall_ = std::max<Duration>(loop_stall_, io::now() - began);
  }

  // --- a turn
  void turn();
  void post_turn();
  Outbox::More settle();
  void read_sockets();
  std::size_t receive_ready();
  std::size_t receive(const Port& port);
  void wait_writable(Port& port);
  bool tell_events();
  void tell(Event&& event);
  bool handle_due();
  bool lose_gone_links();
  void arm(Outbox::More more);

  boost::asio::io_context context_{1};
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work_;
  boost::asio::steady_timer timer_;
  // When the timer will fire; nothing while it is not armed.
  std::optional<TimePoint> armed_;
  boost::asio::signal_set signals_;
  std::atomic<int> signal_{0};
  SessionId session_;
  Endpoint endpoint_;
  std::optional<PeerId> peer_;
  LinkSet links_;
  boost::asio::posix::stream_descriptor nic_watcher_;
  std::optional<TimePoint> recheck_at_;
  // Knows the sockets of ports_; the watcher waits for it.
  io::Poller poller_;
  boost::asio::posix::stream_descriptor socket_watcher_;
  // Whether the loop wakes up for sockets that are ready, or else lets datagrams gather until then.
  bool waits_for_sockets_ = false;
  std::optional<TimePoint> gathers_until_;
  // When sockets were last found to have something.
  TimePoint read_at_ = TimePoint::min();
  std::vector<Port> ports_;
  Outbox outbox_;
  Duration loop_stall_{};
  // The endpoint was told no later time than this when the loop waits.
  TimePoint told_ = TimePoint::min();
  bool turn_posted_ = false;
  bool ran_ = false;
  // Where there are several shards: which this is, 0 for the front, who owns them.
  std::uint8_t shard_ = 0;
  Shards* crew_ = nullptr;
  std::unique_ptr<Shards> shards_;
  // Members are destroyed in reverse order: the workers end before what their jobs refer to.
  Workers computation_;
  Workers backup_;
};

}  // namespace interneuron
