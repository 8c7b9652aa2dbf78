// The requirement table: what a policy asks of links, and the one place where links are matched to
// it (docs/paper.md, "Requirement table").
#pragma once

#include <cstddef>
#include <limits>
#include <span>

#include "interneuron/link.h"

namespace interneuron {

struct Requirement {
  // Floors, in units. A link that is measured to be worse is dropped; a link not measured yet is
  // kept.
  Duration max_rtt = Duration::max();
  DataRate min_rate{};
  double max_loss = 1.0;
  double min_security = 0.0;
  // Weights of the ranking; need not sum to 1.
  Nature weights{};
  // How many links are wanted at most.
  std::size_t links = std::numeric_limits<std::size_t>::max();
};

// The links that are up, may be used and meet every floor, best first: by the operator's priority
// (smaller first), then by weighted score; ties keep the order of `links`. Backup links only where
// no normal link meets the floors. Of more than kMaxLinks the best. Pure; allocates nothing.
Links match(const Requirement& requirement, std::span<const LinkState> links);

}  // namespace interneuron
