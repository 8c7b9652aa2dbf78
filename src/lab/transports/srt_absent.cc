// In place of srt.cc where SRT with bonding was not there when this program was built.
#include "app/process/failure.h"
#include "lab/transports/ends.h"

namespace interneuron::transports {
namespace {

constexpr const char* kSrtReason =
    "this program was built without SRT bonding; `scripts/build_srt.sh` builds it, then configure "
    "and build again";

}  // namespace

std::optional<std::string> lacks_srt() { return kSrtReason; }

VehiclesRecord send_srt(const Order& /*order*/, const Begin& /*ready*/) {
  throw process::Failure(process::kCannotHere, kSrtReason);
}

void receive_srt(const Order& /*order*/, const Ready& /*ready*/, Reception& /*reception*/) {
  throw process::Failure(process::kCannotHere, kSrtReason);
}

}  // namespace interneuron::transports
