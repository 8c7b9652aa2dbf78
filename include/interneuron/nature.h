// Nature: how well a link does on delay, bandwidth, reliability and security, relative to the best
// link that is up (docs/paper.md, "Nature").
#pragma once

namespace interneuron {

// Scores in [0, 1], one per field: the best link has 1, a link that is down has 0 everywhere. Also
// used for weights: how much each field matters to a message.
struct Nature {
  double delay = 0;
  double bandwidth = 0;
  double reliability = 0;
  double security = 0;
  friend bool operator==(const Nature&, const Nature&) = default;
};

}  // namespace interneuron
