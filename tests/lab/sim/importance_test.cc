// Twice as much as a link carries, half of it important.
#include <array>
#include <cstdio>

#include "echo_duo.h"

namespace interneuron::sim::importance_test {
namespace {

TEST(Importance, UnderOverloadWhatMattersMoreArrives) {
  EchoDuo duo({constant_link("a", 40, 20, 20)});
  constexpr std::size_t kBytes = 20 * 1024;
  constexpr int kMessages = 1000;
  constexpr std::uint8_t kImportant = 200;
  const std::uint8_t usual = SendOptions{}.importance;
  std::array<int, 256> arrived{};
  duo.world.on_event([&](HostId host, Event&& event) {
    const auto* message = std::get_if<Message>(&event);
    if (message != nullptr && host == duo.road) ++arrived[message->importance];
  });
  // A message of 20 KiB takes 8.5 ms; one comes every 5 ms, and every other one is important: those
  // alone take 85 % of the link.
  for (int i = 0; i < kMessages; ++i) {
    duo.world.at(2s + i * 5ms, [&duo, usual, i] {
      SendOptions options{
          .deadline = 150ms, .policy = "best_link", .importance = i % 2 == 0 ? kImportant : usual};
      duo.world.endpoint(duo.vehicle)
          .send(duo.world.local_time(duo.vehicle), duo.peer, {Bytes(kBytes)}, options);
    });
  }
  duo.world.run_until(2s + kMessages * 5ms + 1s);
  std::printf("of %d each: %d important ones and %d others on time\n", kMessages / 2,
              arrived[kImportant], arrived[usual]);
  // Before the link is known to be loaded they are equal.
  EXPECT_GE(arrived[kImportant], kMessages / 2 * 9 / 10);
  EXPECT_GE(arrived[kImportant] + arrived[usual], kMessages / 2 * 85 / 100);
}

}  // namespace
}  // namespace interneuron::sim::importance_test
