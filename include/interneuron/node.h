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
  // "wwan0"; the socket is bound to it and sends and receives nowhere else. The name of a NIC that
  // is there when the node starts; it need not be ready then, and may come and go.
  std::string nic;
  LinkTraits traits = {};
  // Numeric address to bind, without port. Empty: every address of the NIC, IPv4 if `peer` is IPv4
  // or (without peer) the NIC has an IPv4 address, else IPv6; answers leave from the address that
  // was asked.
  std::string local_address = {};
  // Where the peer is reached over this link, "10.0.0.2:47000". Empty: this link only answers.
  std::string peer = {};
  std::size_t mtu = 0;  // of the IP layer, bytes; 0 = ask the NIC
};

// Links for NICs that are not named one by one: each NIC that matches, now or when it is plugged
// in, becomes a link with the smallest free id; the link ends when the NIC goes.
struct NodeNicRule {
  // A glob of names ("wwan*"; matches no loopback card), "kind:wwan" (see io::Nic::kind),
  // "mac:02:00:…": these may match nothing for now. A plain name must be that of a NIC that is
  // there when the node starts.
  std::string pattern;
  LinkTraits traits = {};
  std::string peer = {};
};

struct NodeOptions {
  std::vector<NodeLink> links;     // ids must differ; with `rules` at least one of both
  std::vector<NodeNicRule> rules;  // the first that matches a NIC wins; named links win over rules
  std::uint16_t port = 0;          // local UDP port on every link; 0 = any free one, per link
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
  // Puts something of the application's between the node and the socket of a link that was opened,
  // to record or to disturb; called on the loop thread. Empty: nothing. Must not return nullptr.
  std::function<std::unique_ptr<Transport>(LinkId, std::unique_ptr<Transport>)> wrap_transport = {};
};

// What the kernel says of a link's NIC has changed. `reason`: one line, for people.
struct NicChanged {
  LinkId link{};
  std::string nic;
  NicState from{};
  NicState to{};
  std::string reason;
};

// What Node::on_statistics() tells: all that is measured, as values.
struct Statistics {
  struct Link {
    LinkId id{};
    std::string nic;
    NicState nic_state{};
    std::string reason;  // of the newest change of nic_state
    LinkCounters counters;
    TransportCounters transport;
  };
  struct Peer {
    PeerId id{};
    std::vector<LinkState> links;
  };
  TimePoint at{};
  std::vector<Link> links;
  std::vector<Peer> peers;
  EndpointCounters counters;
};

// Jobs of one queue wait for each other, jobs of different queues never do: a local backup does not
// stand in line behind a detection.
enum class Queue : std::uint8_t { kComputation, kLocalBackup };

class Node {
 public:
  using Task = std::function<void()>;
  // Runs on a worker thread; what it returns (may be empty) runs on the loop thread.
  using Job = std::function<Task()>;

  // Opens the sockets of the links whose NICs are ready, at least one, and, if links name peers,
  // begins to talk to them as one peer (peer()). The other links wait for their NICs. Throws
  // IoError (NIC, port, permission; no NIC that can be used) or std::invalid_argument naming the
  // option; nothing stays open then.
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
  // A link is used while its NIC is kReady; it is closed before this is told, and opened after.
  void on_nic_changed(std::function<void(NicChanged)> handler);
  void on_path_changed(std::function<void(PathChanged)> handler);
  // Every `interval` (> 0) while run() runs.
  void on_statistics(Duration interval, std::function<void(const Statistics&)> handler);

  // --- commands, as in Endpoint, at now()
  PeerId connect(std::span<const std::pair<LinkId, Address>> addresses);
  // Measures the rate of a path now instead of when its evidence is old; metered ones too.
  bool request_train(PeerId peer, LinkId link);
  RoundRef begin_round(PipelineId pipeline);
  Plan preview(RoundRef round, std::span<const std::size_t> variant_bytes,
               MessageClass message_class, std::span<const VariantCost> costs = {},
               std::optional<PeerId> to = std::nullopt);
  std::size_t begin_computation(RoundRef round, std::span<const LevelProfile> levels,
                                std::size_t top);
  SubmitStatus submit(RoundRef round, Variants variants, MessageClass message_class,
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
  // The peer that NodeLink::peer names; nothing while no link to it has been opened.
  std::optional<PeerId> peer() const;
  std::vector<PeerId> peers() const;
  std::vector<LinkState> links(PeerId peer) const;  // as believed now
  Statistics statistics() const;
  EndpointCounters counters() const;
  LinkCounters link_counters(LinkId link) const;
  std::size_t reassembly_bytes() const;
  // Zeros and nothing for a link that is not there or waits for its NIC; a new incarnation of the
  // NIC counts from zero.
  TransportCounters transport_counters(LinkId link) const;
  TransportCaps transport_capabilities(LinkId link) const;
  std::optional<Address> local_address(LinkId link) const;  // with the port in use
  // Datagrams dropped because the NIC took nothing for longer than it may (kStallPatience of
  // src/host/node/outbox.h).
  std::uint64_t stalled_datagrams(LinkId link) const;
  // What the set-up could not get as asked, one line with the remedy each (small socket buffers, a
  // NIC that a rule matches but that cannot be opened).
  const std::vector<std::string>& warnings() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace interneuron
