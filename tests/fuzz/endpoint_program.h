// An input as a program for a World: which steps, in which order, with which values. What the fuzz
// target and its test share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "tests/fuzz/endpoint_world.h"

namespace interneuron::fuzz {

// Steps of a program; what follows them is not used, so that an input has a bounded time.
inline constexpr std::size_t kMostSteps = 200;

// What a program came to, for tests to see that programs reach deep.
struct ProgramResult {
  std::size_t steps = 0;
  std::size_t peers = 0;
  std::uint64_t messages_completed = 0;
};

// Does what the bytes say, and ends the program where the endpoint breaks its word (World).
ProgramResult run_program(std::span<const std::uint8_t> input, World::Protection protection);

}  // namespace interneuron::fuzz
