// JPEG files that cost whoever decodes them far more than whoever sends them: what the attacks of
// tests/netns/attacker put into their images. All show a grey area in one colour. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "interneuron/units.h"

namespace interneuron::attacker {

// A well-formed baseline file with one scan: 2 bits for each 8 x 8 pixels, so that 8 million pixels
// are 32 KB. Sides are 8 … 65,528 pixels and multiples of 8. Padded with comments to `least` bytes.
Bytes flat_jpeg(std::uint16_t width, std::uint16_t height, std::size_t least = 0);

// A progressive file of at most `bytes`, and nearly that many: each of its scans has some 20 bytes,
// and makes a decoder go over the coefficients of the whole picture once more.
Bytes bomb_jpeg(std::uint16_t width, std::uint16_t height, std::size_t bytes);

}  // namespace interneuron::attacker
