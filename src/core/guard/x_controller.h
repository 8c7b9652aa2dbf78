// X, the guard's tolerance, and the timeout handler, at the origin (docs/paper.md, "X and the
// timeout handler"). Integers in 1/1000. Pure.
#pragma once

#include <cstdint>
#include <optional>

#include "core/guard/round_guard.h"

namespace interneuron::guard {

class XController {
 public:
  struct Options {
    std::int16_t beta_permille = 0;
    bool use_x = true;
    bool use_handler = true;
  };
  explicit XController(Options options) : options_(options) {}

  // What a round is sent with; degraded: one round per miss.
  using Sent = RoundGuard::Sent;
  // A round begins; base_n: the reference of the whole pipeline, if there is one.
  Sent begin(std::optional<Duration> base_n, Duration deadline);
  // A round was decided.
  void on_time(bool sent_while_recovering);
  void missed();

 private:
  Options options_;
  std::int32_t x_ = 0;
  bool recovering_ = false;
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
