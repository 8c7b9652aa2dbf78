#include "netns/emulator/frames.h"

#include <gtest/gtest.h>

#include <vector>

namespace interneuron::netns::frame_store_test {
namespace {

std::vector<std::byte> frame(std::size_t size, int fill) {
  return std::vector<std::byte>(size, static_cast<std::byte>(fill));
}

bool holds(std::span<const std::byte> stored, const std::vector<std::byte>& expected) {
  return std::equal(stored.begin(), stored.end(), expected.begin(), expected.end());
}

TEST(FrameStore, KeepsFramesUntilReleasedInAnyOrder) {
  FrameStore store;
  std::vector<FrameStore::Handle> handles;
  constexpr int kFrames = 300;  // more than one block
  for (int i = 0; i < kFrames; ++i) {
    handles.push_back(store.add(frame(static_cast<std::size_t>(i) + 1, i)));
  }
  EXPECT_EQ(store.size(), 300U);
  for (int i = 0; i < kFrames; i += 2) store.release(handles[static_cast<std::size_t>(i)]);
  for (int i = 1; i < kFrames; i += 2) {
    const auto n = static_cast<std::size_t>(i);
    EXPECT_TRUE(holds(store[handles[n]], frame(n + 1, i)));
  }
  EXPECT_EQ(store.size(), 150U);
}

TEST(FrameStore, ReusesPlaces) {
  FrameStore store;
  const auto first = store.add(frame(FrameStore::kPlaceBytes, 1));
  store.release(first);
  for (int i = 0; i < 10'000; ++i) {
    const auto handle = store.add(frame(100, i));
    EXPECT_EQ(handle, first);
    store.release(handle);
  }
  EXPECT_EQ(store.size(), 0U);
}

}  // namespace
}  // namespace interneuron::netns::frame_store_test
