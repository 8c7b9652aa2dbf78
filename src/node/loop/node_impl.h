// The loop of a Node. Everything runs on the loop thread, except post(), stop() and the jobs of the
// workers.
//
// The loop sleeps in one system call (io::Poller) until sockets are ready, something is due or a
// task was posted. Then it reads, runs what is due and what was posted, and has a turn, as after
// each task: what may leave leaves, what happened is told, time-outs that are due are handled.
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "interneuron/endpoint.h"
#include "interneuron/node.h"
#include "node/io/poller.h"
#include "node/io/steady_clock.h"
#include "node/loop/link_set.h"
#include "node/loop/mailbox.h"
#include "node/loop/outbox.h"
#include "node/loop/workers.h"

namespace interneuron {

class Node::Impl : private Outbox::Source, private LinkSet::User {
 public:
  class Shards;
  class Whole;

  // What a loop that is one of several tells the others: the Shards of a Node, which make and hold
  // these loops. `shard`: who tells it; 0 is the front, which is the door.
  class Crew {
   public:
    virtual ~Crew() = default;
    // Starts the threads of the shards.
    virtual void start() = 0;
    // Waits for the threads; what they had to tell and nobody has read is dropped.
    virtual void stop() = 0;
    // A link has opened, with a transport for each shard, or is about to close.
    virtual void open(const LinkSet::Link& link) = 0;
    virtual void close(LinkId link) = 0;
    // Waits until there is room for events, and locks the shard: everything that its thread does is
    // done between this and the end of what it gives. The front locks nothing.
    virtual std::unique_lock<std::mutex> enter(std::uint8_t shard) = 0;
    // The front tells the application of it, in the order in which it came.
    virtual void hand_up(std::uint8_t shard, Event&& event) = 0;
    // Whether the datagram is for another one than `shard`, which then gets a copy.
    virtual bool pass(std::uint8_t shard, LinkId link, const Incoming& datagram) = 0;
    virtual void hand_on(HandedOn&& letter, TimePoint at) = 0;
    // Sends over these links have found their NICs gone.
    virtual void lost(std::vector<std::pair<LinkId, int>> gone) = 0;
  };

  explicit Impl(NodeOptions options);
  // One of several shards, which the front looks after.
  Impl(const EndpointOptions& endpoint, Crew& crew);
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
    std::function<void()> statistics;
    Duration statistics_interval{};
  };

  void run();
  void stop() {
    stopped_ = true;
    poller_.wake();
  }
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
  // What the poller calls the handle that tells of NICs; links have other names.
  static constexpr std::uint32_t kNics = UINT32_MAX;
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
  using Ready = std::span<const io::Poller::Ready>;
  void wake_up(Ready ready);
  void read_sockets(Ready ready);
  void run_due();
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
  // What was read in one go.
  struct Reading {
    std::size_t datagrams = 0;
    // The fewest pieces that a message lacks still of which one came; 0: also something else came.
    std::size_t missing = SIZE_MAX;
  };
  Outbox::More turn();
  void post_turn();
  Outbox::More settle();
  void receive(const Port& port, Reading& reading);
  void gather(TimePoint now, const Reading& reading);
  void wait_writable(Port& port);
  void writable(Port& port);
  bool tell_events();
  void tell(Event&& event);
  bool handle_due();
  bool lose_gone_links();
  void plan_wait(Outbox::More more);

  io::Poller poller_;
  std::atomic<bool> stopped_{false};
  std::unique_ptr<SignalThread> signals_;
  std::atomic<int> signal_{0};
  Mailbox<Task> posted_{SIZE_MAX};
  std::multimap<TimePoint, Task> due_;
  SessionId session_;
  Endpoint endpoint_;
  std::optional<PeerId> peer_;
  LinkSet links_;
  std::optional<TimePoint> recheck_at_;
  // When the loop wakes up although nothing comes.
  TimePoint wakes_at_ = TimePoint::min();
  // The loop does not wake up for datagrams until then, so that they gather.
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
  Crew* crew_ = nullptr;
  // The front's, else nullptr.
  std::unique_ptr<Crew> shards_;
  // Members are destroyed in reverse order: the workers end before what their jobs refer to.
  Workers computation_;
  Workers backup_;
};

}  // namespace interneuron
