// What an idle modem would bring is not refused, whatever is believed of it.
#include "lab/sim/duo.h"
#include "support.h"

namespace interneuron::sim::refusals_test {
namespace {

// Messages at 10 Hz from kBegin on, all of one size, and when one was refused.
class Camera : public Duo {
 public:
  Camera(const std::vector<emu::LinkProfile>& links, const char* policy, std::size_t bytes,
         Duration deadline)
      : Duo(links, {}), policy_(policy), bytes_(bytes), deadline_(deadline) {}

  void run(Duration length) {
    for (Duration t = kBegin; t < kBegin + length; t += 100ms) {
      world.at(t, [this, t] { send_at(t); });
    }
    world.run_until(kBegin + length + 1s);
  }
  void change(Duration at, std::uint8_t link, const std::string& what) {
    world.at(at, [this, link, what] {
      world.change(world.wire_of(LinkId{link}),
                   std::get<emu::LinkChange>(emu::parse_change(std::vector<std::string>{what})));
    });
  }
  // Those that were sent in [from, until).
  std::size_t refused(Duration from = {}, Duration until = 1h) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(refused_, [&](Duration t) { return t >= from && t < until; }));
  }

 protected:
  void handle(HostId, Event&&) override {}

 private:
  void send_at(Duration t) {
    const SendResult result =
        world.endpoint(vehicle).send(world.local_time(vehicle), peer, numbered({bytes_}, 0),
                                     {.deadline = deadline_, .policy = policy_});
    if (result.status == SendStatus::kCannotArrive) refused_.push_back(t);
    world.flush(vehicle);
  }

  std::string policy_;
  std::size_t bytes_;
  Duration deadline_;
  std::vector<Duration> refused_;
};

// 8 Mbit/s, for three seconds a twentieth of it, and 8 again.
TEST(Refusals, AModemThatIsBackIsTriedWithoutDelay) {
  for (const char* policy : {"best_link", "coded", "duplicate"}) {
    Camera camera({constant_link("a", 40, 8, 8)}, policy, 40'000, 150ms);
    camera.change(5s, 0, "up.rate_mbit=0.4");
    camera.change(8s, 0, "up.rate_mbit=8");
    camera.run(12s);
    EXPECT_EQ(camera.refused(8s), 0U) << policy;
  }
}

// The first modem carries nothing like the message, and the second one has room.
TEST(Refusals, AnotherModemThatThePolicyAllowsIsAsked) {
  Camera camera({constant_link("a", 20, 40, 40), constant_link("b", 60, 8, 8)}, "coded", 40'000,
                150ms);
  camera.change(4s, 0, "up.rate_mbit=0.2");
  camera.run(12s);
  EXPECT_EQ(camera.refused(), 0U);
}

TEST(Refusals, PacketsThatAreOvertakenAreNoReason) {
  Camera camera({constant_link("a", 40, 60, 60)}, "best_link", 128 * 1024, 200ms);
  camera.world.faults(LinkId{0}).reorder = 0.05;
  camera.world.faults(LinkId{0}).reorder_by = 100ms;
  camera.run(kSanitized ? 5s : 40s);
  EXPECT_EQ(camera.refused(), 0U);
}

// Nothing makes 4 MB of a modem of 8 Mbit/s within 100 ms.
TEST(Refusals, WhatNoModemBringsIsRefused) {
  Camera camera({constant_link("a", 40, 8, 8)}, "best_link", 4'000'000, 100ms);
  camera.run(1s);
  EXPECT_GE(camera.refused(), 9U);
}

}  // namespace
}  // namespace interneuron::sim::refusals_test
