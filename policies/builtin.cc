#include "policies/builtin.h"

namespace interneuron {
namespace {

constexpr double kTrusted = 0.5;  // NOTES §2: encrypted, or on a network of the operator's own

}  // namespace

PolicySet builtin_policies() {
  using namespace policies;
  return {policies::best_link(),     policies::duplicate(),
          policies::down_sampling(), policies::progressive(),
          policies::joint(),         policies::placement(),
          policies::split(),         secure(policies::down_sampling(), kTrusted, "secure")};
}

}  // namespace interneuron
