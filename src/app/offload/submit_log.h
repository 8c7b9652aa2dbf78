// Says in the log why messages are not sent.
#pragma once

#include <string>
#include <utility>

#include "interneuron/round.h"
#include "interneuron/submit_status.h"

namespace interneuron::offload {

// Turns the answers of submit() into warnings, once for each reason in a row: without a link every
// round is refused alike. Quiet about a round that is over, which is ordinary for a late result,
// and about what the policy refuses, which the event Planned tells. For one thread.
class SubmitLog {
 public:
  // `what` the messages are: "image", "result".
  explicit SubmitLog(std::string what) : what_(std::move(what)) {}

  void submitted(const RoundRef& round, SubmitStatus status);

 private:
  std::string what_;
  SubmitStatus newest_ = SubmitStatus::kAccepted;
};

}  // namespace interneuron::offload
