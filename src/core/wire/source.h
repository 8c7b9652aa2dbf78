// A piece as a part of a window's symbols: what its packet says of the message beside its number
// and index, then its bytes (docs/wire_format.md, "Window (type 6)"). What is decoded from symbols
// is a piece like one that has come itself, and is checked as such.
//
// Functions without state. Pure; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/wire/packet.h"

namespace interneuron::wire {

using SourceHeader = std::array<std::byte, kSourceHeaderBytes>;

// What stands before the bytes of a piece.
SourceHeader source_header(const FragmentHeader& fragment);

// The piece that a decoded source is; nothing where it cannot be one, because a symbol has lied:
// parse() would have refused it, it is of a message of more pieces than a window covers, or what
// follows it is not zero. The bytes are a part of `source`.
std::optional<Data> get_source(MessageId message, std::uint8_t index, ByteView source);

}  // namespace interneuron::wire
