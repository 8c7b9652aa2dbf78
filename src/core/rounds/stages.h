// The remote side of rounds at one endpoint: which stages were served, what the application is
// working on, which variants are held. Uses guard::StageGuard for every judgement and the policies'
// merge() for every delivery. Pure; thread-compatible; bounded.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/base/round_ring.h"
#include "core/guard/stage_guard.h"
#include "core/wire/round_header.h"
#include "interneuron/endpoint.h"

namespace interneuron {

// What preview() answered: submit() carries it out.
struct Previewed {
  Plan plan;
  std::size_t variants = 0;

  // Whether a message of so many variants can still be sent so.
  bool fits(std::size_t count, std::span<const LinkState> links) const;
};

// A round that the application works on here, between two communications.
struct RoundContext {
  wire::RoundHeader header;  // as it came in; at the origin: as it will go out
  std::optional<PeerId> from;
  std::size_t stage = 0;     // the last stage that ended
  Verdict verdict;           // of that stage
  TimePoint began{};         // the computation that goes on; until it is told of: the hand-over
  bool mode_chosen = false;  // verdict.late is the guard's choice for the next transmission
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
  using ClockOf = std::optional<guard::ClockView>;

  // What is to become of an arrived message.
  enum class Action : std::uint8_t { kServe, kHold, kDrop };
  Action arrive(TimePoint now, Arrived& arrived, const Policy* policy, const ClockOf& clock,
                guard::StageGuard& observer);

  // A message is served: marks the stage, records θ, opens the round's context, drops what is held
  // of it.
  Delivered serve(TimePoint now, Arrived arrived, const ClockOf& clock,
                  guard::StageGuard& observer);

  // Held variants whose time is over at `now`, in the order of their time.
  struct Released {
    Arrived arrived;
    guard::StageGuard::Hold hold;
  };
  std::vector<Released> release(TimePoint now);
  Delivered serve_held(Released released, guard::StageGuard& observer);

  // The last stage of a round that began here is over, whatever became of it: further copies are
  // dropped.
  void finish(const wire::RoundHeader& header);

  std::optional<TimePoint> next_timeout() const;
  RoundContext* context(const RoundRef& round);
  // Whether a message of this round was handed to the application here, lately (the last kRing
  // rounds of its pipeline).
  bool has_served(const RoundRef& round) const;
  void open(TimePoint now, const RoundRef& round, RoundContext context, Duration deadline);
  void close(const RoundRef& round) { contexts_.erase(round); }

  // The guard of an origin's pipeline, of the kind that its header asks for; the least recently
  // used one makes room.
  guard::StageGuard& observer(const wire::RoundHeader& header, PeerId via);
  void forget_clock(PeerId via);

 private:
  static constexpr std::size_t kMaxObservers = 64;  // vehicles times pipelines at once; chosen
  static constexpr std::size_t kMaxContexts = 1024;
  static constexpr std::size_t kMaxHeld = 64;
  static constexpr std::size_t kMaxHeldBytes =
      64 * 1024 * 1024;  // beyond it, what could be held is served

  struct Key {
    SessionId origin;
    PipelineId pipeline;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  struct Observed {
    std::unique_ptr<guard::StageGuard> guard;
    GuardKind kind{};
    PeerId via{};
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

  std::map<Key, Observed> observers_;
  std::map<Key, RoundRing<Served>> served_;
  std::map<RoundRef, Opened> contexts_;
  std::vector<Released> held_;
  std::uint64_t uses_ = 0;
};

}  // namespace interneuron
