// The rounds in progress at one endpoint: which stages were served, which variants are held for a
// better one, and which rounds the application works on. Stages asks the policy of a round
// (merge()) and the guard of its pipeline (guard::StageGuard) about each message, and carries out
// what they answer; it judges nothing itself.
//
// Owned and fed by Rounds. Headers come from peers and may name any origin, pipeline and round. All
// that is kept is bounded: guards and served stages of as many pipelines as there may be peers, but
// kFewObservers at least (the one that was least recently used makes room), kContexts rounds of
// each that the application works on, and a held variant of each up to kMaxHeldBytes. A message
// beyond these bounds is served at once instead of held, and a message of a round that is too old
// to be remembered is dropped. Pure; thread-compatible.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/stage_guard.h"
#include "core/wire/round_header.h"
#include "interneuron/endpoint.h"

namespace interneuron {

// The plan that preview() has answered, which submit() carries out.
struct Previewed {
  Plan plan;
  // How many variants it was made for.
  std::size_t variants = 0;

  // Whether a message of `count` variants can still be sent by this plan.
  bool fits(std::size_t count, std::span<const LinkState> links) const;
};

// A round that the application works on here, between two communications.
struct RoundContext {
  // As it came in; at the origin, as it will go out.
  wire::RoundHeader header;
  // Where it came from; nothing at the origin.
  std::optional<PeerId> from;
  // The last stage that ended; 0 before the first.
  std::size_t stage = 0;
  // The judgement of that stage.
  Verdict verdict;
  // When the computation in progress began; until begin_computation() tells, when the message was
  // handed over.
  TimePoint began{};
  // verdict.late is what the guard has decided for the next transmission, and stays.
  bool mode_chosen = false;
  std::optional<Previewed> previewed;
};

// A complete message, taken apart.
struct Arrived {
  wire::RoundHeader header;
  Bytes payload;
  PeerId from{};
};

class Stages {
 public:
  // `peers`: how many peers there may be.
  explicit Stages(std::size_t peers) : most_(std::max(kFewObservers, peers)) {}

  // The clock between the origin of a round and here; nothing at the origin and while it is not
  // known.
  using ClockOf = std::optional<guard::ClockView>;

  // What is to become of an arrived message.
  enum class Action : std::uint8_t {
    // Serve it now, by serve() or, after the last stage, by finish().
    kServe,
    // It was taken and is held; release() returns it when its time is over.
    kHold,
    // The stage was served already, or a variant at least as good is held.
    kDrop,
  };
  // `policy`: of the round, nullptr where it is not registered here; then the first variant that
  // comes is served.
  Action arrive(TimePoint now, Arrived& arrived, const Policy* policy, const ClockOf& clock,
                guard::StageGuard& observer);

  // Serves a message: ends the stage before the guard, drops what is held of the stage, and opens
  // the round's context for the application.
  Delivered serve(TimePoint now, Arrived arrived, const ClockOf& clock,
                  guard::StageGuard& observer);

  struct Released {
    Arrived arrived;
    guard::StageGuard::Hold hold;
  };
  // Takes the held variants whose time is over at `now`, in the order of their time.
  std::vector<Released> release(TimePoint now);
  // The same as serve(), at the instant at which the hold was to end.
  Delivered serve_held(Released released, guard::StageGuard& observer);

  // The stage of this header is over, whatever became of it: further copies are dropped.
  void finish(const wire::RoundHeader& header);

  // When the next hold ends.
  std::optional<TimePoint> next_timeout() const;

  // The context of a round that the application works on; nullptr where there is none (any more).
  RoundContext* context(const RoundRef& round);
  // Whether a message of this round was handed to the application here lately: of the last 64
  // rounds of its pipeline.
  bool has_served(const RoundRef& round) const;
  // Opens a context. It is kept for twice the deadline, since a computation may hand over late.
  void open(TimePoint now, const RoundRef& round, RoundContext context, Duration deadline);
  void close(RoundRef round);

  // The guard of the pipeline that this header belongs to, of the kind that the header asks for.
  // `via`: the peer whose clock it learns with. Valid until the next call.
  guard::StageGuard& observer(const wire::RoundHeader& header, PeerId via);
  // The clock of this peer has stepped, or it has begun a new session.
  void forget_clock(PeerId via);

 private:
  // Vehicles times pipelines that are served at once, where there may be few peers.
  static constexpr std::size_t kFewObservers = 64;
  // Rounds of each of those pipelines that the application may work on.
  static constexpr std::size_t kContexts = 16;
  static constexpr std::size_t kMaxHeldBytes = 64 * 1024 * 1024;

  struct Key {
    SessionId origin;
    PipelineId pipeline;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  struct Observed {
    std::unique_ptr<guard::StageGuard> guard;
    GuardKind kind{};
    PeerId via{};
    // The number of the use that was the last one.
    std::uint64_t used = 0;
  };
  // Which stages of a round were served: bit n stands for stage n.
  using Served = std::uint32_t;
  struct Opened {
    RoundContext context;
    TimePoint expires{};
  };

  Served* served(const wire::RoundHeader& header);
  Delivered deliver(TimePoint now, Arrived arrived, const Verdict& verdict);
  void drop_held(const wire::RoundHeader& header);
  bool held_is_full(std::size_t further_bytes) const;

  // How many pipelines are kept, and for how many of them a message may be held.
  std::size_t most_ = kFewObservers;
  std::map<Key, Observed> observers_;
  std::map<Key, RoundRing<Served>> served_;
  std::map<RoundRef, Opened> contexts_;
  // When the time of each context is over.
  std::set<std::pair<TimePoint, RoundRef>> expiries_;
  std::vector<Released> held_;
  std::uint64_t uses_ = 0;
};

}  // namespace interneuron
