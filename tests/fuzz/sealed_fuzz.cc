// The programs of the target `endpoint` where packets are encrypted: the hosts are insiders, whose
// keys are trusted and who seal whatever the input says, under any number, after a handshake. One
// is a stranger. Handshakes that no honest host makes are those of the target `handshake`.
#include "tests/fuzz/endpoint_program.h"
#include "tests/fuzz/finding.h"

namespace {

using namespace interneuron;

// What a program may take where nothing is instrumented: that of the target `endpoint`, and as much
// for its handshakes.
constexpr Duration kMostTime = std::chrono::milliseconds(100);
// How much longer it takes under AddressSanitizer, UBSan and the counters of coverage, at -O1.
constexpr int kSanitizers = 10;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ProcessorTime time;
  fuzz::run_program({data, size}, fuzz::World::Protection::kSealed);
  time.require_at_most(kMostTime * kSanitizers, "a program took too long");
  return 0;
}
