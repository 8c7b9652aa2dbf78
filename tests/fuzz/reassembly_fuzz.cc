// The second fuzzer's entry point: a sequence of fragments and repair symbols.
#include "tests/fuzz/reassembly.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  interneuron::flow::reassemble_any({data, size});
  return 0;
}
