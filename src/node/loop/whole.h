// A Node over all of its shards, or its one endpoint: to whom a command goes, and the sums of what
// is counted.
#pragma once

#include <span>
#include <vector>

#include "node/loop/shards.h"

namespace interneuron {

// Lives for one call, on the loop thread. Commands mean what those of Endpoint do.
class Node::Impl::Whole {
 public:
  // The crew of a front is always its Shards (node.cc makes it).
  explicit Whole(Impl& front) : front_(front), shards_(static_cast<Shards*>(front.shards_.get())) {}

  // Runs a command or a question on the endpoint to which this peer, or this round, belongs.
  template <class Command>
  auto ask(PeerId peer, const Command& command) {
    return shards_ != nullptr ? shards_->ask(shard_of(peer, shards_->count()), command)
                              : command(front_.endpoint_);
  }
  template <class Command>
  auto ask(const RoundRef& round, const Command& command) {
    return shards_ != nullptr ? shards_->ask(shards_->of_round(round), command)
                              : command(front_.endpoint_);
  }
  SendResult send(PeerId peer, Variants variants, const SendOptions& options);
  std::vector<SendResult> send(PeerId peer, std::span<Bytes> messages, const SendOptions& options);
  bool cancel(SendId message);

  std::vector<PeerId> peers();
  EndpointCounters counters();
  LinkCounters link_counters(LinkId link);
  TransportCounters transport_counters(LinkId link);
  std::uint64_t stalled(LinkId link);
  std::int64_t unix_time_ns();
  Statistics statistics();

 private:
  Impl& front_;
  // nullptr: there is one shard.
  Shards* shards_;
};

}  // namespace interneuron
