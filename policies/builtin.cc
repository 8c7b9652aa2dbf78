#include "interneuron/policy.h"

#include "policies/builtin.h"

namespace interneuron {
namespace {

// The security score of a link whose packets are encrypted or whose network the operator trusts
// (docs/paper.md, "Nature").
constexpr double kEncryptedOrTrusted = 0.5;

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
          secure(policies::down_sampling(), kEncryptedOrTrusted, "secure"),
          trusted_only(policies::down_sampling(), "trusted_only")};
}

}  // namespace interneuron
