#include "policies/builtin.h"

namespace interneuron {

PolicySet builtin_policies() {
  return {policies::best_link(), policies::duplicate(), policies::down_sampling()};
}

}  // namespace interneuron
