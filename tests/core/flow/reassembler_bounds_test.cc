// What a Reassembler holds and takes, whatever a peer sends.
#include <gtest/gtest.h>

#include "core/code/erasure_code.h"
#include "core/flow/receiver.h"

namespace interneuron::flow {
namespace {

using namespace std::chrono_literals;
using Result = Reassembler::Result;

constexpr ClockBounds kNoClocks{};

// A packet of a message, which brings as many bytes as it has to.
wire::Data packet(const wire::FragmentHeader& message, std::size_t index, const Bytes& bytes) {
  wire::Data d{message, {}};
  d.fragment.index = static_cast<std::uint16_t>(index);
  d.bytes = ByteView(bytes).first(d.fragment.bytes());
  return d;
}

// No packet brings such a symbol; where one came by another way, it would be longer than the room
// that decoding has for it.
TEST(ReassemblerBounds, ASymbolThatIsLongerThanAnyPieceIsBad) {
  Reassembler r;
  const Bytes bytes(20'000);
  const wire::FragmentHeader message{MessageId{1}, 0,         20'000,
                                     40'000,       1'000'000, wire::MessageKind::kPlain};
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 0, bytes), kNoClocks).result, Result::kStored);
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 2, bytes), kNoClocks).result, Result::kBad);
  EXPECT_EQ(r.add(TimePoint{1s}, packet(message, 1, bytes), kNoClocks).result, Result::kComplete);
}

}  // namespace
}  // namespace interneuron::flow
