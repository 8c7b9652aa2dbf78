// How long the roadside unit may compute so that the rounds of a vehicle end on time when nothing
// goes wrong. The vehicle sends it along with every input, and the roadside takes its top level by
// it.
//
// Before the first round the budget comes from the links as they were measured. That knows neither
// the copies on both hosts nor their schedulers, so the first rounds correct it downwards. Then it
// stays: what changes later is the guard's business, and two controllers of one quantity would
// fight each other.
//
// Keeps at most kRounds durations. A roadside unit that lies about its run times can only make the
// budget smaller, never larger than the links allow, and the budget is never negative.
// Thread-compatible; pure.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "interneuron/link.h"
#include "interneuron/time.h"

namespace interneuron::computing {

class ComputationBudget {
 public:
  // The first rounds from which the overhead is learnt, and how many there must be before their
  // median counts.
  static constexpr std::size_t kRounds = 10;
  static constexpr std::size_t kFewest = 3;

  // `deadline` is D_N, from the begin of a round to its answer.
  explicit ComputationBudget(Duration deadline) : deadline_(deadline) {}

  // Takes the budget that the measured links leave for an input of `input_bytes` and a result of
  // `result_bytes`. `preparation` is the time from the begin of a round until its input can leave.
  void estimate(std::span<const LinkState> links, Duration preparation, std::size_t input_bytes,
                std::size_t result_bytes);
  // A round with the largest input was answered remotely and took `overhead` beside its
  // computation. Counts for the first kRounds rounds.
  void learn(Duration overhead);
  // Zero before estimate().
  Duration value() const { return budget_; }

 private:
  Duration deadline_;
  Duration budget_{};
  std::vector<Duration> overheads_;
};

}  // namespace interneuron::computing
