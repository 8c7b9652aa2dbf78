// What measuring programs wrote, as `testbed verify` reads it: ping's lines, captures of tcpdump,
// and tcpdump's last report. The first byte says which; the rest is the text.
#include "netns/verify/readings.h"

#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron::netns::verify;
using interneuron::fuzz::require;

void try_capture(std::string_view bytes) {
  const auto datagrams = parse_capture(bytes);
  // A record takes 16 bytes for itself and 54 for the headers that are read.
  if (datagrams) require(datagrams->size() <= bytes.size() / 70 + 1, "a capture has grown");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  interneuron::fuzz::Input input({data, size});
  switch (input.take<char>()) {
    case 'p': {
      const std::string_view text = input.text();
      require(parse_ping(text).answered.size() <= text.size() / 20 + 1,
              "there are too many answers");
      break;
    }
    case 'c':
      try_capture(input.text());
      break;
    case 'd':
      parse_capture_drops(input.text());
      break;
    default:
      break;
  }
  return 0;
}
