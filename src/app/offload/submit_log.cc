#include "app/offload/submit_log.h"

#include <spdlog/spdlog.h>

namespace interneuron::offload {

void SubmitLog::submitted(const RoundRef& round, SubmitStatus status) {
  if (status == newest_) return;
  newest_ = status;
  switch (status) {
    case SubmitStatus::kAccepted:
    case SubmitStatus::kRoundOver:
    case SubmitStatus::kRefusedByPolicy:
      return;
    case SubmitStatus::kUnknownRound:
    case SubmitStatus::kNoWayToOrigin:
    case SubmitStatus::kNoPeer:
    case SubmitStatus::kNoLink:
    case SubmitStatus::kOverBudget:
      spdlog::warn("round {}: the {} is not sent: {}", round.round.value, what_, to_string(status));
  }
}

}  // namespace interneuron::offload
