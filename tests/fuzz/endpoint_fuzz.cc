// Sequences of anything into an Endpoint: packets of all types from several peers, time that goes
// back, network cards that come and go, messages and rounds of its own. What must hold is written
// in World; beside it a program may take only so much time.
#include "tests/fuzz/endpoint_program.h"
#include "tests/fuzz/finding.h"

namespace {

using namespace interneuron;

// What a program may take where nothing is instrumented.
constexpr Duration kMostTime = std::chrono::milliseconds(50);
// How much longer it takes under AddressSanitizer, UBSan and the counters of coverage, at -O1.
constexpr int kSanitizers = 10;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ProcessorTime time;
  fuzz::run_program({data, size}, fuzz::World::Protection::kClear);
  time.require_at_most(kMostTime * kSanitizers, "a program took too long");
  return 0;
}
