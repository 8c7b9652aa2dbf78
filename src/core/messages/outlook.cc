#include "core/messages/outlook.h"

namespace interneuron {

void Outlook::consider(const LinkState& way, std::optional<Duration> arrival,
                       std::optional<Duration> soonest, bool is_refused) {
  const bool sooner = arrival && (!expected || *arrival < *expected);
  if (has_link && (is_refused == refused ? !sooner : is_refused)) return;
  has_link = true;
  refused = is_refused;
  expected = arrival;
  least = soonest;
  path = way.path;
  rtt_min = way.rtt_min;
  rtt_p95 = way.rtt_p95;
  jitter = way.jitter;
  queue = way.queue_up;
  loss = way.loss;
  rate = way.rate;
  share = way.share;
}

}  // namespace interneuron
