// What an Endpoint is made of. Plain values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "interneuron/address.h"
#include "interneuron/ledger.h"
#include "interneuron/message.h"
#include "interneuron/pipeline.h"
#include "interneuron/policy.h"
#include "interneuron/security.h"
#include "interneuron/shard.h"
#include "interneuron/units.h"

namespace interneuron {

struct Ablation;

// 128 bits that nobody else can guess.
using Secret = std::array<std::uint64_t, 2>;

// What an endpoint is made of.
struct EndpointOptions {
  // Names this life of the endpoint: random, not 0, new at every start. No default.
  SessionId session{};
  // The pipelines whose rounds begin here. Default: none, as on a roadside unit.
  std::vector<PipelineConfig> pipelines;
  // Must hold every policy that the pipelines name, and at least one. No default.
  PolicySet policies;
  // Whether peers may come unannounced, as on a roadside unit.
  bool accept_peers = false;
  // How many unannounced peers there may be at a time. A further one takes the place of one that
  // has never heard us, was silent for 15 s or came from a network or host that has two places more
  // than its own; where there is none, it is refused.
  std::size_t max_peers = 64;
  // Random, and told to nobody, so that no peer can choose sessions whose lookup takes long, nor
  // pretend to be at an address where it does not receive; Node draws it. Default: taken from the
  // session, which every peer knows: enough without hostile peers.
  Secret secret{};
  // What the incomplete messages of all peers may hold together, in bytes. A peer may take more as
  // long as it then holds no more than what is left free: one alone gets half of it (and never more
  // than one of the largest messages), n greedy ones a part of n + 1 each, and whoever holds little
  // finds room however greedy the others are. A message that finds none is refused piece by piece
  // and counted in EndpointCounters::reassembly_refused.
  std::size_t reassembly_budget_bytes = 64 * 1024 * 1024;
  // What messages under way to all peers (plain ones and those of rounds, with their headers) may
  // hold together, in bytes, by the same rule: those to one peer alone get half of it. What finds
  // no room is not accepted: SendStatus::kOverBudget, SubmitStatus::kOverBudget. Default: to one
  // peer alone eight of the largest messages.
  std::size_t send_budget_bytes = std::size_t{16} * (kMaxMessageBytes + 1024);
  // What each peer may take of this endpoint.
  PeerLimits peer_limits = {};
  // Peers that may send rounds of other origins than themselves: the nodes before this one of a
  // pipeline over several of them and, where such a pipeline begins here, the last one, if its
  // message did not come from a peer that the round was sent to. Each is named by an address that
  // it sends from, whose port does not matter. What a relay says of others is believed. Default:
  // nobody, so that no peer can send in the name of another one.
  std::vector<Address> relays = {};
  // What packets are encrypted with, and who is trusted. Nothing: they are sent in the clear, and
  // whoever asks is served: for experiments in closed networks alone.
  std::shared_ptr<const Security> security{};
  // Where several endpoints serve one address. They have the same session, the same secret and the
  // same keys, but for their seeds. Default: this one is alone.
  Shard shard = {};
  // For the experiments that ship with the project; its type is no part of the interface. Nothing:
  // every mechanism is there.
  std::shared_ptr<const Ablation> ablation{};
};

}  // namespace interneuron
