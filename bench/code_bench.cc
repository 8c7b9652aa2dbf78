// What the erasure code of src/core/code costs the processor, with vector instructions and without:
// encoding a tenth of a message as repair symbols, and bringing back as many lost pieces.
//
//   build/release/bench/code_bench
//
// Pieces of 1347 bytes, as full datagrams have them; 196 of them are 256 KiB with a header.
#include <benchmark/benchmark.h>

#include <cstdint>
#include <vector>

#include "core/code/erasure_code.h"

namespace interneuron::bench {
namespace {

using namespace code;

constexpr std::size_t kBytes = 1347;

struct Block {
  std::vector<std::vector<std::byte>> pieces;
  std::vector<std::vector<std::byte>> symbols;
  std::vector<std::byte*> piece_bytes;
  std::vector<std::byte*> symbol_bytes;
  std::vector<std::uint8_t> missing;
  std::vector<Symbol> use;

  Block(std::size_t count, std::size_t rows)
      : pieces(count, std::vector<std::byte>(kBytes)),
        symbols(rows, std::vector<std::byte>(kBytes)) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t b = 0; b < kBytes; ++b)
        pieces[i][b] = static_cast<std::byte>(i * 31 + b * 7);
      piece_bytes.push_back(pieces[i].data());
    }
    for (auto& symbol : symbols) symbol_bytes.push_back(symbol.data());
    for (std::size_t i = 0; i < rows; ++i) {
      missing.push_back(static_cast<std::uint8_t>(i * count / rows));
      use.push_back({static_cast<std::uint8_t>(i), symbol_bytes[i]});
    }
  }
  std::vector<const std::byte*> in() const { return {piece_bytes.begin(), piece_bytes.end()}; }
};

void Encode(benchmark::State& state, Kernel kernel) {
  Block block(static_cast<std::size_t>(state.range(0)), static_cast<std::size_t>(state.range(1)));
  const auto in = block.in();
  for (auto _ : state) {
    encode(in, kBytes, 0, block.symbol_bytes, kernel);
    benchmark::ClobberMemory();
  }
}

// The symbols are what the decoding before left of them: the same work, whatever comes out.
void Decode(benchmark::State& state, Kernel kernel) {
  Block block(static_cast<std::size_t>(state.range(0)), static_cast<std::size_t>(state.range(1)));
  for (auto _ : state) {
    decode(block.piece_bytes, kBytes, block.missing, block.use, kernel);
    benchmark::ClobberMemory();
  }
}

BENCHMARK_CAPTURE(Encode, vector, Kernel::kVector)
    ->Args({98, 10})
    ->Args({196, 20})
    ->Args({200, 55});
BENCHMARK_CAPTURE(Decode, vector, Kernel::kVector)
    ->Args({98, 1})
    ->Args({98, 10})
    ->Args({196, 20})
    ->Args({200, 55});
BENCHMARK_CAPTURE(Encode, scalar, Kernel::kScalar)->Args({98, 10})->Args({196, 20});
BENCHMARK_CAPTURE(Decode, scalar, Kernel::kScalar)->Args({98, 10})->Args({196, 20});

}  // namespace
}  // namespace interneuron::bench

BENCHMARK_MAIN();
