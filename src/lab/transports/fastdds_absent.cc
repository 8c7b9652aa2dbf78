// In place of fastdds.cc where Fast DDS was not there when this program was built.
#include "app/process/failure.h"
#include "lab/transports/ends.h"

namespace interneuron::transports {
namespace {

constexpr const char* kReason =
    "this program was built without Fast DDS; `scripts/setup.sh --with-peers` installs it";

}  // namespace

std::optional<std::string> lacks_fastdds() { return kReason; }

VehiclesRecord send_fastdds(const Order& /*order*/, const Begin& /*ready*/) {
  throw process::Failure(process::kCannotHere, kReason);
}

void receive_fastdds(const Order& /*order*/, const Ready& /*ready*/, Reception& /*reception*/) {
  throw process::Failure(process::kCannotHere, kReason);
}

}  // namespace interneuron::transports
