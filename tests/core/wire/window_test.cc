#include "core/wire/window.h"

#include <gtest/gtest.h>

#include "core/code/field.h"
#include "core/wire/packet.h"
#include "core/wire/source.h"
#include "tests/core/wire/consistent.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire::window_test {
namespace {

constexpr std::size_t kRoom = kMaxDatagramBytes;

// The pieces that the documented window covers, as sources.
std::vector<Bytes> example_sources() {
  std::vector<Bytes> out;
  const auto add = [&out](const FragmentHeader& f, const Bytes& message) {
    const SourceHeader head = source_header(f);
    out.emplace_back(head.begin(), head.end());
    const auto from = message.begin() + f.index * f.chunk;
    out.back().insert(out.back().end(), from, from + static_cast<std::ptrdiff_t>(f.bytes()));
  };
  add(example_plain_fragment(), example_plain_message());
  Bytes message = example_plain_message();
  message.resize(kPlainHeaderBytes);
  for (const char c : {'h', 'i'}) message.push_back(static_cast<std::byte>(c));
  for (const std::uint16_t index : {std::uint16_t{1}, std::uint16_t{2}}) {
    FragmentHeader f = example_repair_fragment();
    f.index = index;
    add(f, message);
  }
  return out;
}

TEST(Packet, AWindowIsTheDocumentedExample) {
  const std::vector<Bytes> sources = example_sources();
  Bytes symbol(kSourceHeaderBytes + 25);
  std::size_t at = 0;
  example_window().for_each([&](std::size_t column, MessageId, std::uint8_t) {
    code::add_multiple(symbol, sources[at++], code::coefficient(1, column));
  });
  ASSERT_EQ(at, sources.size());
  const PacketHeader header = example_header(PacketType::kWindow, LinkId{2}, 10, kExampleStamp);
  Bytes out(kRoom);
  out.resize(write_window(out, header, example_window(), symbol));
  EXPECT_EQ(out, from_hex(kWindowExample));
  const auto packet = parse(out);
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->header, header);
  EXPECT_EQ(packet->window.header, example_window());
  EXPECT_EQ(packet->window.header.sources(), 3U);
  EXPECT_TRUE(std::ranges::equal(packet->window.bytes, symbol));
}

TEST(Source, IsThePieceThatItWasMadeOf) {
  for (Bytes source : example_sources()) {
    const std::uint8_t index = source.size() > 30 ? 0 : source.size() < 18 ? 2 : 1;
    const auto size = source.size();
    source.resize(kSourceHeaderBytes + 25);
    const auto data = get_source(MessageId{7}, index, source);
    ASSERT_TRUE(data);
    EXPECT_EQ(data->fragment.message, MessageId{7});
    EXPECT_EQ(data->fragment.index, index);
    EXPECT_EQ(data->fragment.lifetime_us, 100'000U);
    EXPECT_EQ(data->bytes.size() + kSourceHeaderBytes, size);
    // What a lie makes of it.
    EXPECT_FALSE(get_source(MessageId{7}, 3, source)) << "no such piece";
    EXPECT_FALSE(get_source(MessageId{7}, index, ByteView(source).first(size - 1)));
    EXPECT_FALSE(get_source(MessageId{7}, index, with(source, 10, 3))) << "no such kind";
    EXPECT_FALSE(get_source(MessageId{7}, index, with(source, 0, 1))) << "too many pieces";
    EXPECT_FALSE(get_source(MessageId{7}, index, with(with(source, 4, 0), 5, 0))) << "no chunk";
    if (size < source.size()) {
      EXPECT_FALSE(get_source(MessageId{7}, index, with(source, source.size() - 1, 1)));
    }
  }
}

TEST(Packet, AWindowIsWithinItsBounds) {
  const auto written = [](std::uint8_t row, std::size_t messages, std::uint8_t pieces,
                          std::size_t bytes) {
    WindowHeader window;
    window.row = row;
    for (std::size_t i = 0; i < messages; ++i) {
      window.messages.push_back({MessageId{static_cast<std::uint32_t>(10 + i)}, pieces});
    }
    Bytes out(2048);
    out.resize(
        write_window(out, example_header(PacketType::kWindow, LinkId{2}, 7), window, Bytes(bytes)));
    return out;
  };
  EXPECT_TRUE(parse(written(54, 16, 0b11, 12)));
  EXPECT_TRUE(parse(written(0, 4, 0xff, kMaxDatagramBytes - kPacketOverhead - 13)));
  EXPECT_FALSE(parse(written(55, 1, 1, 100)));
  EXPECT_FALSE(parse(written(0, 0, 1, 100)));
  EXPECT_FALSE(parse(written(0, 16, 0b111, 100))) << "too many sources";
  EXPECT_FALSE(parse(written(0, 2, 0, 100))) << "no pieces";
  EXPECT_FALSE(parse(written(0, 1, 1, 11))) << "no symbol";
  // A symbol of any length that one datagram cannot bring is refused on its own as well.
  const Bytes longer = written(0, 1, 1, 1412);
  Reader body(ByteView(longer).subspan(kHeaderBytes, longer.size() - kPacketOverhead));
  EXPECT_FALSE(get_window(body));
  Bytes many = written(0, 16, 1, 100);
  many[kHeaderBytes + 1] = std::byte{17};
  EXPECT_FALSE(parse(many));
  Bytes same = written(0, 2, 1, 100);
  same[kHeaderBytes + 7] = std::byte{0};
  EXPECT_FALSE(parse(same));
}

}  // namespace
}  // namespace interneuron::wire::window_test
