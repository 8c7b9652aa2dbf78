// X, the guard's tolerance, and the timeout handler (NOTES §4.5), at the origin. Integers in
// 1/1000. Pure.
#pragma once

#include <cstdint>
#include <optional>

#include "interneuron/time.h"

namespace interneuron::guard {

class XController {
 public:
  struct Options {
    std::int16_t beta_permille = 0;
    bool use_x = true;
    bool use_handler = true;
  };
  explicit XController(Options options) : options_(options) {}

  // What a round is sent with.
  struct Sent {
    std::int16_t x_permille = 0;
    bool recovering = false;
    bool degraded = false;  // its first transmission is sacrificed: one round per miss
  };
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

}  // namespace interneuron::guard
