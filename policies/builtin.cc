#include "policies/builtin.h"

namespace interneuron {
namespace {

// The security score of a link that is encrypted or on a network of the operator's own.
constexpr double kTrusted = 0.5;

}  // namespace

PolicySet builtin_policies() {
  using namespace policies;
  return {policies::best_link(),     policies::duplicate(),
          policies::down_sampling(), policies::progressive(),
          policies::joint(),         policies::placement(),
          policies::split(),         secure(policies::down_sampling(), kTrusted, "secure")};
}

}  // namespace interneuron
