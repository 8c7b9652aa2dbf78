// The fuzzer's entry point: any bytes as a datagram and as a message. Stops the program where bytes
// are neither refused nor valid. Built twice: with libFuzzer (preset fuzz), and into the test
// that feeds it seeded mutations.
#include <cstdint>
#include <cstdlib>

#include "core/wire/source.h"
#include "tests/core/wire/consistent.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace wire = interneuron::wire;
  const interneuron::ByteView bytes = std::as_bytes(std::span(data, size));
  if (!wire::refused_or_consistent(bytes) || !wire::refused_or_consistent_message(bytes)) {
    std::abort();
  }
  const auto packet = wire::parse(bytes);
  const bool opens_a_message = packet && packet->header.type == wire::PacketType::kData;
  if (opens_a_message && (!wire::refused_or_consistent_message(packet->data.bytes) ||
                          !wire::refused_or_consistent_plain(packet->data.bytes))) {
    std::abort();
  }
  // What is decoded from a window is what a packet could have brought.
  const auto index = static_cast<std::uint8_t>(size % wire::kMostWindowPieces);
  const auto source = wire::get_source(interneuron::MessageId{1}, index, bytes);
  if (source && (source->bytes.size() != source->fragment.bytes() || source->bytes.empty() ||
                 source->fragment.is_repair())) {
    std::abort();
  }
  if (packet && wire::other_version(bytes)) std::abort();
  return 0;
}
