// Packets of other versions are told from bytes that are none, and never taken for ours.
#include <gtest/gtest.h>

#include "core/wire/packet.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire {
namespace {

Bytes with(Bytes bytes, std::size_t at, int value) {
  bytes.at(at) = static_cast<std::byte>(value);
  return bytes;
}

TEST(Version, OfVersion1ItIsSaidSo) {
  // A probe as version 1 wrote it: type, path, epoch, reserved, session, number; padding; tag.
  const Bytes probe = from_hex("03 01 00 00 5e ed 00 01 00 00 00 00 00 00 01 2d");
  for (const std::size_t padding : {std::size_t{0}, std::size_t{8}, std::size_t{1368}}) {
    Bytes bytes = probe;
    bytes.resize(probe.size() + padding + kTagBytes);
    EXPECT_FALSE(parse(bytes));
    EXPECT_EQ(other_version(bytes), 1);
    for (const std::size_t at : {std::size_t{2}, std::size_t{3}, bytes.size() - 1}) {
      EXPECT_EQ(other_version(with(bytes, at, 1)), std::nullopt) << at;
    }
    EXPECT_EQ(other_version(with(bytes, 0, 0)), std::nullopt);
    EXPECT_EQ(other_version(with(bytes, 0, 5)), std::nullopt);
    bytes.resize(31);
    EXPECT_EQ(other_version(bytes), std::nullopt);
  }
}

TEST(Version, OfLaterVersionsItIsSaidSo) {
  Bytes bytes = from_hex(kProbeExample);
  for (int version = 3; version < 16; ++version) {
    const Bytes later = with(bytes, 0, version << 4 | 7);
    EXPECT_FALSE(parse(later));
    EXPECT_EQ(other_version(later), version);
  }
  std::fill_n(bytes.begin() + 4, 4, std::byte{0});
  EXPECT_EQ(other_version(with(bytes, 0, 0x30)), std::nullopt);
}

TEST(Version, AStampCountsMicrosecondsAndWraps) {
  EXPECT_EQ(send_stamp(TimePoint{Duration{1'999}}), 1u);
  EXPECT_EQ(send_stamp(TimePoint{std::chrono::microseconds(UINT32_MAX)}), UINT32_MAX);
  EXPECT_EQ(send_stamp(TimePoint{std::chrono::microseconds(std::int64_t{UINT32_MAX} + 3)}), 2u);
  EXPECT_EQ(send_stamp(TimePoint{Duration{-1}}), UINT32_MAX);
}

}  // namespace
}  // namespace interneuron::wire
