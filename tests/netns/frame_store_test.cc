#include "netns/frame_store.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace interneuron::netns {
namespace {

std::vector<std::byte> frame_of(std::size_t size, unsigned value) {
  return std::vector<std::byte>(size, static_cast<std::byte>(value & 0xffU));
}

TEST(FrameStore, ReturnsWhatWasPutInOrder) {
  FrameStore store;
  std::mt19937 random(1);
  std::size_t put = 0;
  std::size_t taken = 0;
  const auto size_of = [](std::size_t i) { return 60 + i * 37 % 1455; };
  while (taken < 100'000) {
    for (std::size_t n = random() % 900; n > 0; --n, ++put) {
      store.push(frame_of(size_of(put), static_cast<unsigned>(put)));
    }
    ASSERT_EQ(store.size(), put - taken);
    for (std::size_t n = std::min<std::size_t>(random() % 1000, store.size()); n > 0;
         --n, ++taken) {
      const auto frame = store.at(0);
      const auto expected = frame_of(size_of(taken), static_cast<unsigned>(taken));
      ASSERT_TRUE(std::equal(frame.begin(), frame.end(), expected.begin(), expected.end()))
          << taken;
      store.pop_oldest();
    }
  }
}

TEST(FrameStore, FramesStayWhereTheyAreWhileOthersComeAndGo) {
  FrameStore store;
  store.push(frame_of(1000, 1));
  const auto kept = store.push(frame_of(1000, 2));
  for (unsigned i = 0; i < 1000; ++i) store.push(frame_of(1000, 3));
  store.pop_oldest();
  EXPECT_EQ(kept.data(), store.at(0).data());
  EXPECT_EQ(std::to_integer<int>(kept[999]), 2);
}

}  // namespace
}  // namespace interneuron::netns
