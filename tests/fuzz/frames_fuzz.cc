// Frames of a network card: what transports beside the kernel's IP layer receive, and what the
// testbed's emulator marks and completes. The first byte is the context; the rest is the frame.
#include <array>

#include "netns/emulator/frames.h"
#include "node/ring/frame.h"
#include "tests/fuzz/finding.h"
#include "tests/fuzz/input.h"

namespace {

using namespace interneuron;
using fuzz::require;

// The frame that these headers and this payload make, without a VLAN tag.
Bytes frame_of(const io::ParsedFrame& parsed, bool ethernet) {
  io::FrameAddresses addresses;
  if (ethernet) addresses.ethernet = io::EthernetHeader{};
  addresses.from = parsed.from;
  addresses.to = parsed.to;
  addresses.ecn = parsed.ecn;
  auto header = io::build_header(addresses, parsed.payload.size());
  require(header.has_value(), "a frame that was accepted cannot be built");
  io::complete_checksum(*header, std::array{parsed.payload});
  Bytes out(header->view().begin(), header->view().end());
  out.insert(out.end(), parsed.payload.begin(), parsed.payload.end());
  return out;
}

void try_frame(ByteView frame, const io::FrameContext& context) {
  const auto result = io::parse_frame(frame, context);
  if (const auto* problem = std::get_if<io::FrameProblem>(&result)) {
    require(!io::name_of(*problem).empty(), "a problem has no name");
    return;
  }
  const auto& parsed = std::get<io::ParsedFrame>(result);
  require(parsed.payload.empty() ||
              (parsed.payload.data() >= frame.data() &&
               parsed.payload.data() + parsed.payload.size() <= frame.data() + frame.size()),
          "a payload is not within its frame");
  require(is_ipv6(parsed.from) == is_ipv6(parsed.to) && parsed.ecn <= 3, "a frame is inconsistent");
  if (parsed.payload.size() > io::kMostPayloadBytes) return;
  // What was accepted is accepted again when it is built anew, with a checksum that is verified.
  const Bytes again = frame_of(parsed, context.ethernet);
  io::FrameContext strict = context;
  strict.checksum_known = false;
  strict.may_be_partial = false;
  const auto second = io::parse_frame(again, strict);
  const auto* read = std::get_if<io::ParsedFrame>(&second);
  require(read != nullptr && read->from == parsed.from && read->to == parsed.to &&
              read->ecn == parsed.ecn && std::ranges::equal(read->payload, parsed.payload),
          "a frame has changed by being built anew");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input input({data, size});
  const auto flags = input.take<std::uint8_t>();
  io::FrameContext context{.ethernet = (flags & 1U) == 0,
                           .checksum_known = (flags & 2U) != 0,
                           .may_be_partial = (flags & 4U) != 0,
                           .loopback = (flags & 8U) != 0,
                           .device = 3};
  const ByteView frame = input.bytes(size);
  try_frame(frame, context);
  Bytes copy(frame.begin(), frame.end());
  netns::complete_checksum(copy);
  return 0;
}
