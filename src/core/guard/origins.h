// The two rules behind RoundGuard: PaperOrigin is that of the paper, BudgetOrigin maximises the
// expected quality of the answer. Pure; thread-compatible.
#pragma once

#include <cstdint>
#include <optional>

#include "core/base/round_ring.h"
#include "core/guard/choice.h"
#include "core/guard/residual_law.h"
#include "core/guard/round_guard.h"

namespace interneuron::guard {

// X, the tolerance of the paper's guard, and the timeout handler, at the origin (docs/paper.md, "X
// and the timeout handler"). X is relative to the reference times: 0 allows what is usual, -1
// allows nothing. It is kept in integers of 1/1000.
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

// GuardKind::kBudget at the origin: sends the first transmission in the mode (which variant is the
// best one sent) that maximises the expected quality of the answer, in which a miss costs its
// price.
//
// All modes are weighed alike: by the forecast of the links, by what forecasts of such copies erred
// by in the last 10 s (or all forecasts, where there was none), and by the law of what rounds lose
// against both. So a wrong estimate does not rule a mode out for ever. 20 KB; nothing is allocated
// after construction. As RoundGuard in all else.
class BudgetOrigin final : public RoundGuard {
 public:
  explicit BudgetOrigin(const PipelineConfig& config);

  Sent begin(std::optional<Duration>, Duration) override { return {}; }
  bool weighs() const override { return true; }
  // Where modes are worth the same, the one with the smallest message, which is the safest.
  std::size_t choose_mode(TimePoint now, RoundId round, Duration since,
                          std::span<const Forecast> modes) override;
  void result(TimePoint now, RoundId round, Duration e2e, const Spent& spent) override;
  void on_time(const Sent&) override {}
  void missed(TimePoint now, RoundId round) override;

 private:
  // A round whose first transmission has left, with the forecast of the mode it left in from t0 on.
  struct Entry {
    bool known = false;  // the end-to-end time was learnt
    Forecast forecast{};
  };

  // What forecasts of copies with this key err by.
  Duration error(TimePoint now, std::uint8_t key) const;

  Duration deadline_;
  Terms terms_;
  // Where none are configured, one level, with the run time that results tell of.
  bool learns_level_;
  std::vector<LevelProfile> levels_;
  ResidualLaw law_;
  Speed speed_;
  Recent computed_;
  RoundRing<Entry> sent_;
};

}  // namespace interneuron::guard
