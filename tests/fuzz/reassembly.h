// Any fragments and repair symbols into a Reassembler, as bytes say: what the second fuzzer and its
// test share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace interneuron::flow {

// Each operation takes so many bytes of the input; what is left over is not used.
inline constexpr std::size_t kOperationBytes = 8;

// Messages of which the operations bring pieces: small ones, some of several blocks, and some whose
// pieces and symbols are as long as can be.
inline constexpr std::size_t kMessages = 8;

struct Reassembled {
  std::size_t packets = 0;
  // How often each message was complete.
  std::array<std::size_t, kMessages> complete{};
};

// Does what the bytes say, and ends the program where a Reassembler breaks its word: holds more
// than it may, hands a message out twice or in another size, or changes one of which only true
// pieces came.
Reassembled reassemble_any(std::span<const std::uint8_t> input);

}  // namespace interneuron::flow
