// What a link does for a variant, in words.
#include "interneuron/policy.h"

namespace interneuron {

std::string_view to_string(SendRole role) {
  switch (role) {
    case SendRole::kWhole:
      return "whole";
    case SendRole::kShare:
      return "share";
    case SendRole::kParity:
      return "parity";
    case SendRole::kShadow:
      return "shadow";
  }
  return "";
}

}  // namespace interneuron
