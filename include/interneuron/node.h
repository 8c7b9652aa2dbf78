// The application's door: a Node drives an Endpoint with real sockets and the real clock.
// send.h says what a message and its fate are, pipeline.h what rounds are, node_options.h what a
// node is made of.
//
//   Node node(options);
//   node.on_peer_ready([&](PeerReady p) { node.send(p.peer, bytes, {.deadline = 100ms}); });
//   node.on_fate([&](MessageFate fate) { /* what became of a message */ });
//   node.on_message([&](Message message) { /* one that the peer has sent */ });
//   node.stop_on_signals();
//   node.run();  // until stop()
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "interneuron/counters.h"
#include "interneuron/events.h"
#include "interneuron/node_options.h"
#include "interneuron/submit_status.h"
#include "interneuron/transport.h"

namespace interneuron {

// What the kernel says of a link's NIC has changed.
struct NicChanged {
  LinkId link{};
  std::string nic;
  NicState from{};
  NicState to{};
  // One line, for people.
  std::string reason;
  // Nothing has changed: the link was opened after the node had started, and `reason` is what
  // Node::warnings() would have had of it; or it cannot be opened, and `reason` says why.
  bool is_warning = false;
};

// All that is measured, at one instant.
struct Statistics {
  struct Link {
    LinkId id{};
    std::string nic;
    NicState nic_state{};
    // Why the NIC is in this state, one line.
    std::string reason;
    LinkCounters counters;
    TransportCounters transport;
  };
  struct Peer {
    PeerId id{};
    std::vector<LinkState> links;
    // What it holds here, and which limits have struck it.
    PeerLedger ledger;
  };
  TimePoint at{};
  std::vector<Link> links;
  std::vector<Peer> peers;
  EndpointCounters counters;
  // The longest time that one handler, task or continuation of the application kept the loop since
  // run() began. Meanwhile nothing is received and nothing leaves; what computes for longer than a
  // few milliseconds belongs to Node::compute().
  Duration loop_stall{};
};

// Where a job of Node::compute() waits for a thread. Jobs of one queue wait for each other, jobs of
// different queues never do: a local backup does not stand in line behind a detection.
enum class Queue : std::uint8_t { kComputation, kLocalBackup };

// Owns one UDP socket per network card (NIC), one event loop and a few worker threads.
//
// Threads: the thread that calls run() is the loop thread. Every handler, timer and continuation
// runs on it, one at a time, and all methods belong to it, except those that say "any thread".
// Before run() the constructing thread counts as the loop thread; what it commands leaves when
// run() starts. A handler that computes for long delays every deadline: use compute(). All of this
// holds where further threads serve peers, too (NodeOptions::shards).
//
// Commands have the same meaning, errors and bounds as those of Endpoint.
class Node {
 public:
  using Task = std::function<void()>;
  // Runs on a worker thread; the task that it returns (may be empty) runs on the loop thread.
  using Job = std::function<Task()>;

  // Opens the sockets of the links whose NICs are ready, at least one, and, if links name peers,
  // begins to talk to them as one peer (peer()). The other links wait for their NICs. Throws
  // IoError (NIC, port, permission; no NIC that can be used) or std::invalid_argument naming the
  // option; nothing stays open then.
  explicit Node(NodeOptions options);
  // Waits for the jobs that are running and drops those that are queued. Must not be called while
  // another thread is in run().
  ~Node();
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  // --- handlers; set before run()
  void on_delivered(std::function<void(Delivered)> handler);
  void on_round_done(std::function<void(RoundDone)> handler);
  void on_peer_ready(std::function<void(PeerReady)> handler);
  void on_peer_restarted(std::function<void(PeerRestarted)> handler);
  void on_peer_lost(std::function<void(PeerLost)> handler);
  void on_planned(std::function<void(Planned)> handler);
  // A link is used while its NIC is kReady; it is closed before this is told, and opened after.
  void on_nic_changed(std::function<void(NicChanged)> handler);
  void on_path_changed(std::function<void(PathChanged)> handler);
  void on_peer_limited(std::function<void(PeerLimited)> handler);
  void on_revocations_changed(std::function<void(RevocationsChanged)> handler);
  void on_key_shared(std::function<void(KeyShared)> handler);
  void on_message(std::function<void(Message)> handler);
  void on_fate(std::function<void(MessageFate)> handler);
  void on_can_send(std::function<void(CanSend)> handler);
  void on_other_version(std::function<void(OtherVersion)> handler);
  // Every `interval` (> 0) while run() runs.
  void on_statistics(Duration interval, std::function<void(const Statistics&)> handler);

  // --- commands, as in Endpoint, at now()
  PeerId connect(std::span<const std::pair<LinkId, Address>> addresses,
                 const std::optional<PublicKey>& key = std::nullopt);
  // Measures the rate of a path now instead of when its evidence is old, metered ones too. False
  // when there is no such path.
  bool request_train(PeerId peer, LinkId link);
  // Takes the bytes. The message leaves with the end of this turn of the loop.
  SendResult send(PeerId peer, Bytes message, const SendOptions& options = {});
  SendResult send(PeerId peer, Variants variants, const SendOptions& options = {});
  // Many at once, in their order, each a message of its own. Takes their bytes.
  std::vector<SendResult> send(PeerId peer, std::span<Bytes> messages,
                               const SendOptions& options = {});
  bool cancel(SendId message);
  RoundRef begin_round(PipelineId pipeline);
  // The plan is kept and changes what submit() sends; see Endpoint::preview().
  Plan preview(RoundRef round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs = {},
               std::optional<PeerId> to = std::nullopt);
  std::size_t begin_computation(RoundRef round, std::span<const LevelProfile> levels,
                                std::size_t top);
  SubmitStatus submit(RoundRef round, Variants variants, MessageClass message_class,
                      std::optional<PeerId> to = std::nullopt);
  void local_result(RoundRef round, Bytes result);
  void give_up(RoundRef round);

  // --- time and work
  // CLOCK_MONOTONIC; any thread.
  TimePoint now() const;
  // Run `task` once on the loop thread, not before the given time; soon if that is past.
  void after(Duration delay, Task task);
  void at(TimePoint time, Task task);
  // Runs `job` on a thread of the queue.
  void compute(Queue queue, Job job);
  // Runs `task` on the loop thread; any thread.
  void post(Task task);

  // --- running
  // Serves until stop(); may be called once. At the end what can leave without waiting still
  // leaves; rounds that are undecided get no answer. Throws what a handler, task or job threw,
  // after the workers have ended.
  void run();
  // Any thread; before run() too.
  void stop();
  // SIGINT and SIGTERM call stop() while run() runs.
  void stop_on_signals();
  // The signal that ended run(), 0 if none did.
  int stopped_by_signal() const;

  // --- getters
  SessionId session() const;
  // The peer that NodeLink::peer names; nothing while no link to it has been opened.
  std::optional<PeerId> peer() const;
  std::vector<PeerId> peers() const;
  // What is believed of the links to this peer at this instant.
  std::vector<LinkState> links(PeerId peer) const;
  Statistics statistics() const;
  EndpointCounters counters() const;
  LinkCounters link_counters(LinkId link) const;
  // Bytes held by incomplete messages of all peers.
  std::size_t reassembly_bytes() const;
  // See Endpoint::unix_time_ns(): what a host without a clock of its own has to store.
  std::int64_t unix_time_ns() const;
  // The next three give zeros and nothing for a link that is not there or waits for its NIC. A NIC
  // that comes back counts from zero.
  TransportCounters transport_counters(LinkId link) const;
  TransportCaps transport_capabilities(LinkId link) const;
  // With the port in use.
  std::optional<Address> local_address(LinkId link) const;
  // Datagrams that were dropped because the NIC took nothing for longer than it may (kStallPatience
  // of src/node/loop/outbox.h).
  std::uint64_t stalled_datagrams(LinkId link) const;
  // What the set-up could not get as asked, one line with the remedy each (small socket buffers, a
  // NIC that a rule matches but that cannot be opened).
  const std::vector<std::string>& warnings() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
