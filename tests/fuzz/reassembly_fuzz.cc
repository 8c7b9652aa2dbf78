// The second fuzzer's entry point: a sequence of fragments and repair symbols.
#include "tests/fuzz/reassembly.h"

#include <algorithm>

// Operations of one input, of which each may bring a hundred packets: more only take longer.
constexpr std::size_t kMostOperations = 40;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  interneuron::flow::reassemble_any(
      {data, std::min(size, kMostOperations * interneuron::flow::kOperationBytes)});
  return 0;
}
