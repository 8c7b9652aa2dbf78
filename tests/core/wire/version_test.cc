// Packets of other versions are told from bytes that are none, and never taken for ours.
#include <gtest/gtest.h>

#include <random>

#include "core/wire/packet.h"
#include "tests/core/wire/examples.h"

namespace interneuron::wire::version_test {
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

TEST(Version, OfVersion2AndLaterOnesItIsSaidSo) {
  Bytes bytes = from_hex(kProbeExample);
  for (int version = 2; version < 16; ++version) {
    if (version == kVersion) continue;
    const Bytes later = with(bytes, 0, version << 4 | 7);
    EXPECT_FALSE(parse(later));
    EXPECT_EQ(other_version(later), version);
  }
}

// Whoever looks at a log should not be sent to look for another version because of noise.
TEST(Version, BytesWithoutTheHeaderOfAnyVersionAreOfNone) {
  const Bytes later = with(from_hex(kProbeExample), 0, 0x47);
  ASSERT_EQ(other_version(later), 4);
  EXPECT_EQ(other_version(with(later, 0, 0x40)), std::nullopt) << "no type";
  EXPECT_EQ(other_version(with(later, 1, 1)), std::nullopt) << "an epoch nobody agreed on";
  EXPECT_EQ(other_version(with(later, later.size() - 1, 1)), std::nullopt) << "a tag";
  for (const std::ptrdiff_t at : {4, 8}) {
    Bytes without = later;
    std::fill_n(without.begin() + at, at, std::byte{0});
    EXPECT_EQ(other_version(without), std::nullopt) << "no session, or no number";
  }
  EXPECT_EQ(other_version(Bytes(later.begin(), later.begin() + 19)), std::nullopt);
  std::mt19937 random(1);
  for (int i = 0; i < 100'000; ++i) {
    Bytes noise(static_cast<std::size_t>(36 + i % 100));
    for (std::byte& b : noise) b = static_cast<std::byte>(random());
    EXPECT_EQ(other_version(noise), std::nullopt);
  }
}

TEST(Version, AStampCountsMicrosecondsAndWraps) {
  EXPECT_EQ(send_stamp(TimePoint{Duration{1'999}}), 1u);
  EXPECT_EQ(send_stamp(TimePoint{std::chrono::microseconds(UINT32_MAX)}), UINT32_MAX);
  EXPECT_EQ(send_stamp(TimePoint{std::chrono::microseconds(std::int64_t{UINT32_MAX} + 3)}), 2u);
  EXPECT_EQ(send_stamp(TimePoint{Duration{-1}}), UINT32_MAX);
}

}  // namespace
}  // namespace interneuron::wire::version_test
