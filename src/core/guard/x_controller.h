// X, the tolerance of the paper's guard, and the timeout handler, at the origin (docs/paper.md, "X
// and the timeout handler"). X is relative to the reference times: 0 allows what is usual, -1
// allows nothing. It is kept in integers of 1/1000. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>

#include "core/guard/round_guard.h"

namespace interneuron::guard {

class XController {
 public:
  struct Options {
    // β, added to X, in 1/1000.
    std::int16_t beta_permille = 0;
    Ablation ablation{};
  };
  explicit XController(Options options) : options_(options) {}

  using Sent = RoundGuard::Sent;
  // A round begins: as RoundGuard::begin(). One round per miss is sent degraded.
  Sent begin(std::optional<Duration> base_n, Duration deadline);
  // A round was decided.
  void on_time(bool sent_while_recovering);
  void missed();

 private:
  Options options_;
  // X in 1/1000.
  std::int32_t x_ = 0;
  bool recovering_ = false;
  // How many rounds are still to be sent degraded.
  std::uint32_t degrade_next_ = 0;
};

// GuardKind::kPaper at the origin.
class PaperOrigin final : public RoundGuard {
 public:
  explicit PaperOrigin(XController::Options options) : x_(options) {}

  Sent begin(std::optional<Duration> base_n, Duration deadline) override {
    return x_.begin(base_n, deadline);
  }
  void on_time(const Sent& sent) override { x_.on_time(sent.recovering); }
  void missed(TimePoint, RoundId) override { x_.missed(); }

 private:
  XController x_;
};

}  // namespace interneuron::guard
