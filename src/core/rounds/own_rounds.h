// The rounds that begin at this endpoint: a guard::RoundLedger per pipeline, and the header with
// which each round's messages set out. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/guard/round_ledger.h"
#include "core/rounds/stages.h"
#include "interneuron/endpoint.h"

namespace interneuron {

class OwnRounds {
 public:
  // Throws std::invalid_argument naming the pipeline.
  OwnRounds(SessionId self, const std::vector<PipelineConfig>& pipelines);

  // Throws std::invalid_argument when there is no such pipeline.
  RoundContext begin(TimePoint now, PipelineId pipeline);

  bool is_mine(const RoundRef& round) const { return round.origin == self_; }
  // Whether a round of ours has begun. One that has not would push those under way out of the
  // books.
  bool has_begun(const RoundRef& round) const;
  // The pipeline of a round that is_mine(); nothing when there is no such pipeline.
  guard::RoundLedger* find(const RoundRef& round);

  // Rounds whose deadline has passed.
  std::vector<RoundDone> expire(TimePoint now);
  std::optional<TimePoint> next_timeout() const;

 private:
  struct Pipeline {
    guard::RoundLedger ledger;
    std::uint32_t begun = 0;  // rounds so far
  };
  SessionId self_;
  std::map<PipelineId, Pipeline> pipelines_;
};

}  // namespace interneuron
