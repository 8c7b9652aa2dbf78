#include "core/flow/partial.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <random>

#include "core/code/erasure_code.h"

namespace interneuron::flow::partial_test {
namespace {

// A message cut into pieces, with every repair symbol that it may have.
struct Cut {
  wire::FragmentHeader fragment;
  Bytes whole;
  std::vector<Bytes> packets;

  Cut(std::size_t size, std::uint16_t chunk, wire::MessageKind kind, std::uint64_t seed)
      : fragment{MessageId{1}, 0, chunk, static_cast<std::uint32_t>(size), 1000, kind} {
    std::mt19937_64 rng(seed);
    whole.resize(size);
    for (std::byte& b : whole) b = static_cast<std::byte>(rng());
    const code::Blocks blocks(fragment.count());
    Bytes padded = whole;
    padded.resize(blocks.count() * std::size_t{chunk});
    packets.resize(blocks.end());
    for (std::size_t i = 0; i < blocks.count(); ++i) {
      const std::size_t at = i * chunk;
      packets[i].assign(whole.begin() + static_cast<std::ptrdiff_t>(at),
                        whole.begin() + static_cast<std::ptrdiff_t>(std::min(at + chunk, size)));
    }
    for (std::size_t b = 0; b < blocks.blocks(); ++b) {
      std::vector<const std::byte*> in;
      std::vector<std::byte*> out;
      for (std::size_t c = 0; c < blocks.pieces(b); ++c) {
        in.push_back(padded.data() + blocks.piece_at(b, c) * chunk);
      }
      for (std::size_t r = 0; r < code::kMostRows; ++r) {
        packets[blocks.symbol_at(b, r)].resize(chunk);
        out.push_back(packets[blocks.symbol_at(b, r)].data());
      }
      code::encode(in, chunk, 0, out);
    }
  }
};

Bytes joined(const wire::MessageBytes& message) {
  Bytes out(message.header.begin(), message.header.end());
  out.insert(out.end(), message.payload.begin(), message.payload.end());
  return out;
}

// Any pieces and symbols, as many of each block as it has pieces, in any order.
RC_GTEST_PROP(Partial, AnyEnoughPacketsMakeTheMessage, ()) {
  const auto kind =
      *rc::gen::arbitrary<bool>() ? wire::MessageKind::kPlain : wire::MessageKind::kRound;
  const auto chunk = *rc::gen::inRange<std::uint16_t>(1, 60);
  const auto size = *rc::gen::inRange<std::size_t>(1, std::size_t{chunk} * 450);
  const Cut cut(size, chunk, kind, *rc::gen::arbitrary<std::uint64_t>());
  const code::Blocks blocks(cut.fragment.count());
  std::mt19937_64 rng(*rc::gen::arbitrary<std::uint64_t>());
  std::vector<std::uint16_t> order;
  for (std::size_t b = 0; b < blocks.blocks(); ++b) {
    std::vector<std::uint16_t> of_block;
    for (std::size_t i = 0; i < blocks.end(); ++i) {
      if (blocks.block_of(i) == b) of_block.push_back(static_cast<std::uint16_t>(i));
    }
    std::shuffle(of_block.begin(), of_block.end(), rng);
    of_block.resize(blocks.pieces(b));
    order.insert(order.end(), of_block.begin(), of_block.end());
  }
  std::shuffle(order.begin(), order.end(), rng);
  // Often the symbols come first, and move from place to place.
  if (*rc::gen::arbitrary<bool>()) std::ranges::sort(order, std::greater());
  Partial partial;
  partial.begin(cut.fragment);
  for (const std::uint16_t index : order) {
    RC_ASSERT(!partial.complete());
    if (!partial.has(index)) {
      const std::size_t before = partial.held();
      const std::size_t growth = partial.growth(index);
      partial.add(index, cut.packets[index]);
      RC_ASSERT(partial.held() - before <= growth);
    }
    RC_ASSERT(partial.has(index));
  }
  RC_ASSERT(partial.complete());
  RC_ASSERT(joined(partial.take()) == cut.whole);
}

TEST(Partial, AnotherMessageAfterwardsIsAnother) {
  Partial partial;
  for (const std::size_t size : {5000UL, 30UL, 300'000UL, 1UL, 5000UL}) {
    const Cut cut(size, 1347, wire::MessageKind::kPlain, size);
    partial.begin(cut.fragment);
    EXPECT_TRUE(partial.is_open());
    // Without the first piece where there are others: the header is decoded as well.
    const code::Blocks blocks(cut.fragment.count());
    partial.add(static_cast<std::uint16_t>(blocks.symbol_at(0, 3)),
                cut.packets[blocks.symbol_at(0, 3)]);
    for (std::uint16_t i = 1; i < blocks.count(); ++i) partial.add(i, cut.packets[i]);
    ASSERT_TRUE(partial.complete()) << size;
    EXPECT_EQ(joined(partial.take()), cut.whole);
    partial.end();
    EXPECT_FALSE(partial.is_open());
    EXPECT_EQ(partial.held(), 0U);
  }
}

}  // namespace
}  // namespace interneuron::flow::partial_test
