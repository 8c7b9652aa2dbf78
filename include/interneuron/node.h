// The application's door: a Node drives an Endpoint with real sockets and the real clock. It owns
// one UDP socket per network card (NIC), one loop and a few worker threads.
//
//   Node node(options);
//   node.on_peer_ready([&](PeerReady) { /* begin_round, submit */ });
//   node.on_round_done([&](RoundDone done) { … });
//   node.stop_on_signals();
//   node.run();  // until stop()
//
// Threads. The thread that calls run() is the loop thread: every handler, timer and continuation
// runs on it, one at a time, and all methods belong to it, except post() and stop(), which any
// thread may call. Before run() the constructing thread counts as the loop thread; what it commands
// leaves when run() starts. A handler that computes for long delays every deadline: use compute().
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "interneuron/endpoint.h"
#include "interneuron/transport.h"

namespace interneuron {

struct NodeLink {
  LinkId id{};
  std::string nic;  // "wwan0"; the socket is bound to it and sends and receives nowhere else
  // Numeric address to bind, without port. Empty: every address of the NIC, IPv4 if `peer` is IPv4
  // or (without peer) the NIC has an IPv4 address, else IPv6. Name one if the NIC has several:
  // replies otherwise leave from its first.
  std::string local_address = {};
  // Where the peer is reached over this link, "10.0.0.2:47000". Empty: this link only answers.
  std::string peer = {};
  std::size_t mtu = 0;  // of the IP layer, bytes; 0 = ask the NIC
};

struct NodeOptions {
  std::vector<NodeLink> links;  // at least one; ids must differ
  std::uint16_t port = 0;       // local UDP port on every link; 0 = any free one, per link
  std::vector<PipelineConfig> pipelines;  // those whose rounds begin here
  PolicySet policies;                     // empty = builtin_policies()
  bool accept_peers = false;              // true on a roadside unit: peers may come unannounced
  std::size_t max_peers = 64;             // bound on unannounced peers
  bool repair = true;                     // lost fragments are sent again while the deadline allows
  // Sessions are not encrypted yet, so a node that accepts peers refuses to listen on addresses
  // that are not private unless this says so.
  bool insecure = false;
  std::size_t computation_workers = 1;  // threads of Queue::kComputation, 1 … 64
  std::size_t backup_workers = 1;       // threads of Queue::kLocalBackup, 1 … 64
};

// Jobs of one queue wait for each other, jobs of different queues never do: a local backup does not
// stand in line behind a detection.
enum class Queue : std::uint8_t { kComputation, kLocalBackup };

class Node {
 public:
  using Task = std::function<void()>;
  // Runs on a worker thread; what it returns (may be empty) runs on the loop thread.
  using Job = std::function<Task()>;

  // Opens the sockets and, if links name peers, begins to talk to them as one peer (peer()).
  // Throws IoError (NIC, port, permission) or std::invalid_argument naming the option; nothing
  // stays open then.
  explicit Node(NodeOptions options);
  // Waits for the jobs that are running; drops those that are queued. Not while another thread is
  // in run().
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
  // The NIC vanished; the link is no longer used. `reason`: one line.
  void on_link_lost(std::function<void(LinkId link, std::string_view reason)> handler);

  // --- commands, as in Endpoint, at now()
  PeerId connect(std::span<const std::pair<LinkId, Address>> addresses);
  RoundRef begin_round(PipelineId pipeline);
  bool submit(RoundRef round, Variants variants, MessageClass message_class,
              std::optional<PeerId> to = std::nullopt);
  void local_result(RoundRef round, Bytes result);

  // --- time and work
  TimePoint now() const;  // any thread; CLOCK_MONOTONIC
  // Runs `task` once on the loop thread, not before the given time; at once if that is past.
  void after(Duration delay, Task task);
  void at(TimePoint time, Task task);
  void compute(Queue queue, Job job);
  void post(Task task);  // any thread: runs `task` on the loop thread

  // --- running
  // Serves until stop(), once. At the end what can leave without waiting still leaves; rounds that
  // are undecided get no answer. Throws what a handler, task or job threw, after the workers have
  // ended.
  void run();
  void stop();  // any thread; before run() too
  // SIGINT and SIGTERM call stop() while run() runs.
  void stop_on_signals();
  // The signal that ended run(), 0 if none did.
  int stopped_by_signal() const;

  // --- getters
  SessionId session() const;
  std::optional<PeerId> peer() const;  // the peer that NodeLink::peer names
  std::vector<PeerId> peers() const;
  std::vector<LinkState> links(PeerId peer) const;  // as believed now
  EndpointCounters counters() const;
  LinkCounters link_counters(LinkId link) const;
  std::size_t reassembly_bytes() const;
  // Zeros and nothing for a link that is not there (any more).
  TransportCounters transport_counters(LinkId link) const;
  TransportCaps transport_capabilities(LinkId link) const;
  std::optional<Address> local_address(LinkId link) const;  // with the port in use
  // Datagrams dropped because the NIC took nothing for longer than it may (kStallPatience of
  // src/node/outbox.h).
  std::uint64_t stalled_datagrams(LinkId link) const;
  // What the set-up could not get as asked, one line with the remedy each (small socket buffers,
  // several addresses).
  const std::vector<std::string>& warnings() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
