// A systematic erasure code: repair symbols are computed from the pieces of a block, and any as
// many symbols as pieces are missing bring these back.
//
// Reed-Solomon with a Cauchy matrix over GF(2^8) with the polynomial x^8 + x^4 + x^3 + x^2 + 1
// ("An XOR-Based Erasure-Resilient Coding Scheme", Blömer et al.): row r of the symbols has the
// coefficient 1 / ((255 - r) + c) for the piece in column c, which depends on nothing else, so that
// more rows can be computed later without those before. Every square part of such a matrix can be
// inverted, so what is decoded is what was encoded; a symbol that lies gives wrong pieces, which
// only authentication of packets can tell.
//
// Decoding solves for the missing pieces alone: what is there is taken off the symbols, which costs
// as much as encoding them, and a matrix as large as there are missing pieces is inverted.
//
// Functions without state and without heap memory; at most 70 KB of stack. Pure; thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/code/blocks.h"

namespace interneuron::code {

// Which arithmetic is used: ISA-L's vector instructions, or one byte at a time, which is the
// reference that tests compare with.
enum class Kernel : std::uint8_t { kVector, kScalar };

// The largest piece, in bytes: no datagram is larger. Callers check what a peer says before they
// call: decode() keeps sums of this size on its stack.
inline constexpr std::size_t kMostBytes = 1400;

// Writes the symbols first_row … first_row + symbols.size() - 1 of a block of pieces that have
// `bytes` bytes each. At least one piece and at most kMostPieces; the rows are below kMostRows.
void encode(std::span<const std::byte* const> pieces, std::size_t bytes, std::size_t first_row,
            std::span<std::byte* const> symbols, Kernel kernel = Kernel::kVector);

// A symbol at a receiver; its bytes are overwritten by decode().
struct Symbol {
  std::uint8_t row = 0;
  std::byte* bytes = nullptr;
};

// Brings back the pieces in the columns `missing`, which are in rising order: their bytes are
// written where pieces[column] points to. As many symbols, of different rows below kMostRows, as
// pieces are missing.
void decode(std::span<std::byte* const> pieces, std::size_t bytes,
            std::span<const std::uint8_t> missing, std::span<const Symbol> symbols,
            Kernel kernel = Kernel::kVector);

}  // namespace interneuron::code
