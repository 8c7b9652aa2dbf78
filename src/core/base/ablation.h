// What experiments leave away of the mechanisms, to see what each of them is worth. The options of
// endpoints and nodes refer to it, but its type is no part of the interface: applications have all
// of it. A plain value.
#pragma once

namespace interneuron {

struct Ablation {
  // The paper's X; without it X stays 0 until a round is missed.
  bool use_x = true;
  // The paper's timeout handler; without it misses change nothing.
  bool use_handler = true;
  // The paper's guard judges a stage again when the computation after it begins; without it, only
  // when its message is handed over.
  bool judge_at_start = true;
  // Rounds that were sent with X < 0 enter the reference times of the paper's guard, as all others
  // that were on time do.
  bool learn_below_zero = true;
  // Lost fragments are sent again while the deadline allows.
  bool repair = true;
};

}  // namespace interneuron
