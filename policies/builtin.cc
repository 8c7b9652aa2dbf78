#include "policies/builtin.h"

namespace interneuron {
namespace {

// The security score of a link that is encrypted or on a network of the operator's own.
constexpr double kTrusted = 0.5;

}  // namespace

PolicySet builtin_policies() {
  using namespace policies;
  return {policies::best_link(),
          policies::duplicate(),
          policies::down_sampling(),
          policies::progressive(),
          policies::joint(),
          policies::placement(),
          policies::split(),
          policies::coded(),
          policies::stripe(),
          policies::shadow(),
          policies::failover(),
          policies::min_rtt(),
          policies::lowest_latency(),
          policies::reinject(),
          secure(policies::down_sampling(), kTrusted, "secure")};
}

}  // namespace interneuron
