#include "interneuron/link.h"

namespace interneuron {

std::string_view to_string(NicState state) {
  switch (state) {
    case NicState::kAbsent:
      return "absent";
    case NicState::kNoCarrier:
      return "no_carrier";
    case NicState::kNoAddress:
      return "no_address";
    case NicState::kNoRoute:
      return "no_route";
    case NicState::kReady:
      return "ready";
  }
  return "unknown";
}

std::string_view to_string(PathState state) {
  switch (state) {
    case PathState::kOk:
      return "ok";
    case PathState::kSuspect:
      return "suspect";
    case PathState::kPulled:
      return "pulled";
    case PathState::kLatched:
      return "latched";
    case PathState::kDead:
      return "dead";
  }
  return "unknown";
}

std::string_view to_string(EcnState state) {
  switch (state) {
    case EcnState::kTesting:
      return "testing";
    case EcnState::kWorks:
      return "works";
    case EcnState::kBleached:
      return "bleached";
    case EcnState::kRewritten:
      return "rewritten";
    case EcnState::kMangled:
      return "mangled";
    case EcnState::kDropped:
      return "dropped";
  }
  return "unknown";
}

std::string_view to_string(LinkRole role) {
  switch (role) {
    case LinkRole::kNormal:
      return "normal";
    case LinkRole::kBackup:
      return "backup";
    case LinkRole::kNever:
      return "never";
  }
  return "unknown";
}

}  // namespace interneuron
