// Nature: how well a link does on delay, bandwidth, reliability and security, relative to the best
// link that is up (docs/paper.md, "Nature").
#pragma once

namespace interneuron {

// Scores in [0, 1] per field; the best link has 1, a link that is down 0 everywhere. Also used for
// weights.
struct Nature {
  double delay = 0;
  double bandwidth = 0;
  double reliability = 0;
  double security = 0;
  friend bool operator==(const Nature&, const Nature&) = default;
};

}  // namespace interneuron
