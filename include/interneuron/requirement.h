// The requirement table: what a policy asks of links, and the one place where links are matched to
// it (docs/paper.md, "Requirement table").
#pragma once

#include <cstddef>
#include <limits>
#include <span>

#include "interneuron/link.h"

namespace interneuron {

// What a message asks of the links that carry it. A default-constructed Requirement is met by every
// link and ranks them all alike.
struct Requirement {
  // Floors. A link that is measured to be worse is left out; one that is not measured yet is kept.
  //
  // The longest round trip (p95 of the last 2 s). Default: any.
  Duration max_rtt = Duration::max();
  // The least rate towards the peer. Default: any.
  DataRate min_rate{};
  // The largest share of packets lost, in [0, 1]. Default: any.
  double max_loss = 1.0;
  // The least security score, in [0, 1]. Default: any.
  double min_security = 0.0;
  // How much each score counts in the ranking; the weights need not sum to 1.
  Nature weights{};
  // How many links are wanted at most. Default: all.
  std::size_t links = std::numeric_limits<std::size_t>::max();
};

// The links that are up, may be used and meet every floor, best first: by the operator's priority
// (smaller first), then by weighted score; of equals in the order of `links`. Backup links are
// given only when no normal link meets the floors. Of more than kMaxLinks the best are given. Pure;
// allocates nothing.
Links match(const Requirement& requirement, std::span<const LinkState> links);

}  // namespace interneuron
