// Links of netem that follow their model.
#include "netns/netem/netem_backend.h"

#include <gmock/gmock.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <optional>
#include <thread>

#include "host/io/steady_clock.h"
#include "netem_support.h"

namespace interneuron::netns::netem_backend_test {
namespace {

using namespace std::chrono_literals;
using emu::Direction;

double ms(Duration d) { return to_ms(d); }

class NetemBackendTest : public NetemTest {
 protected:
  // `profiles.size()` links, one per veth pair: left is the vehicle, right the core.
  void up(const std::vector<std::string>& profiles) {
    options_.scenario = {};
    if (profiles.size() > 1) join(2, static_cast<int>(profiles.size()));
    for (std::size_t i = 0; i < profiles.size(); ++i) {
      const std::string nic = "veth" + std::to_string(i + 1);
      const auto profile = emu::built_in_profile(profiles[i]);
      ASSERT_TRUE(profile) << profiles[i];
      options_.scenario.links.push_back({"l" + std::to_string(i), *profile, i + 1});
      egresses_.push_back({left_.get(), nic, i, Direction::kUp});
      egresses_.push_back({right_.get(), nic, i, Direction::kDown});
    }
    memory_.resize(SharedStats::bytes(profiles.size()) / sizeof(std::uint64_t) + 1);
    stats_ = SharedStats::construct(memory_.data(), profiles.size());
    bearers_.emplace(options_, Backend::kNetem, control_, *stats_);
    bearers_->attend(task_ready_.get(), [this] {
      std::uint64_t count = 0;
      ASSERT_EQ(::read(task_ready_.get(), &count, sizeof count), 8);
      task_();
    });
    backend_.emplace(egresses_, left_.get(), *bearers_);
  }
  void run() {
    thread_ = std::thread([this] { backend_->run(stop_.get()); });
  }
  // In the backend's thread; returns when it is done.
  void do_there(const std::function<void()>& task) {
    std::promise<void> done;
    task_ = [&task, &done] {
      task();
      done.set_value();
    };
    signal(task_ready_.get());
    done.get_future().wait();
  }
  void stop() {
    if (!thread_.joinable()) return;
    signal(stop_.get());
    thread_.join();
  }
  void TearDown() override {
    stop();
    NetemTest::TearDown();
  }

  static void signal(int event) {
    const std::uint64_t one = 1;
    ASSERT_EQ(::write(event, &one, sizeof one), 8);
  }
  static io::FileDescriptor event() { return io::FileDescriptor(::eventfd(0, EFD_CLOEXEC)); }

  TestbedOptions options_;
  std::vector<NetemBackend::Egress> egresses_;
  ControlServer control_;
  std::vector<std::uint64_t> memory_;
  SharedStats* stats_ = nullptr;
  io::FileDescriptor stop_ = event();
  io::FileDescriptor task_ready_ = event();
  std::function<void()> task_;
  std::optional<Bearers> bearers_;
  std::optional<NetemBackend> backend_;
  std::thread thread_;
};

TEST_F(NetemBackendTest, TimeBeginsWithTheFirstPacket) {
  up({"5g", "4g"});
  const io::FileDescriptor from = udp(false, 2);
  const io::FileDescriptor to = udp(true, 2);
  run();
  rest(200ms);
  EXPECT_EQ(stats_->epoch_ns.load(), 0);
  const TimePoint sent = io::now();
  EXPECT_EQ(stream(from.get(), to.get(), 1).size(), 1U);
  const TimePoint epoch{Duration{stats_->epoch_ns.load()}};
  EXPECT_GE(epoch, sent);
  EXPECT_LT(epoch, sent + 50ms);
  EXPECT_EQ(stats_->link(1).down.load().delivered, 1U);
  EXPECT_EQ(stats_->link(0).down.load().packets_in, 0U);
}

TEST_F(NetemBackendTest, DelayFollowsTheModel) {
  up({"5g", "4g"});
  const io::FileDescriptor from = udp(true, 2);
  const io::FileDescriptor to = udp(false, 2);
  emu::Link model(options_.scenario.links[1].profile, options_.scenario.links[1].seed);
  run();
  std::vector<Arrival> arrivals;
  std::vector<TimePoint> sent;
  for (std::uint32_t i = 0; i < 300; ++i) {
    sent.push_back(io::now());
    send_numbered(from.get(), i, 1, 100);
    rest(10ms);
  }
  receive_numbered(to.get(), arrivals, 1s);
  stop();
  ASSERT_GE(arrivals.size(), 280U);
  EXPECT_TRUE(
      std::is_sorted(arrivals.begin(), arrivals.end(),
                     [](const Arrival& a, const Arrival& b) { return a.number < b.number; }));
  const TimePoint epoch{Duration{stats_->epoch_ns.load()}};
  std::vector<double> errors;
  TimePoint last{};
  for (const Arrival& a : arrivals) {
    const Duration at = std::max(Duration{}, sent[a.number] - epoch);
    const TimePoint due = sent[a.number] + model.conditions(Direction::kUp, at).one_way;
    last = std::max(last, due);
    errors.push_back(std::abs(ms(sent[a.number] + a.delay - last)));
  }
  std::sort(errors.begin(), errors.end());
  std::printf("error of the delay: median %.3f, 90 %% %.3f, max %.3f ms; %.1f requests a step\n",
              errors[errors.size() / 2], errors[errors.size() * 9 / 10], errors.back(),
              static_cast<double>(backend_->effort().requests) /
                  static_cast<double>(backend_->effort().steps));
  EXPECT_LT(errors[errors.size() / 2], 2.0);
}

TEST_F(NetemBackendTest, FourNicsFollowFiftyTimesASecond) {
  up({"5g", "4g"});
  const io::FileDescriptor from = udp(true, 1);
  const io::FileDescriptor to = udp(false, 1);
  run();
  ASSERT_EQ(stream(from.get(), to.get(), 1).size(), 1U);
  rest(3s);
  stop();
  const double seconds = ms(io::now() - TimePoint{Duration{stats_->epoch_ns.load()}}) / 1000;
  const NetemBackend::Effort& effort = backend_->effort();
  const double per_nic = static_cast<double>(effort.requests) / 4 / seconds;
  std::printf("%.1f changes a second and NIC; %lu steps, %lu skipped, %lu put off\n", per_nic,
              effort.steps, effort.skipped, effort.put_off);
  if (effort.skipped > effort.steps / 4) GTEST_SKIP() << "the machine is too busy to tell";
  EXPECT_GE(per_nic, 50);
  EXPECT_EQ(effort.failed, 0U);
}

TEST_F(NetemBackendTest, EightyNicsShareTheTime) {
  up(std::vector<std::string>(40, "5g"));
  const io::FileDescriptor from = udp(true, 40);
  const io::FileDescriptor to = udp(false, 40);
  run();
  EXPECT_GE(stream(from.get(), to.get(), 1000).size(), 900U);
  rest(3s);
  stop();
  const NetemBackend::Effort& effort = backend_->effort();
  std::printf("%lu steps, %lu skipped, %lu requests, %lu put off\n", effort.steps, effort.skipped,
              effort.requests, effort.put_off);
  EXPECT_GT(effort.requests, 80U * 20);
  EXPECT_EQ(effort.failed, 0U);
}

TEST_F(NetemBackendTest, ChangesAndOutagesTakeEffect) {
  up({"5g"});
  const io::FileDescriptor from = udp(true, 1);
  const io::FileDescriptor to = udp(false, 1);
  run();
  ASSERT_GE(stream(from.get(), to.get(), 100).size(), 95U);
  do_there([&] {
    emu::LinkChange change;
    change.rtt = 200ms;
    change.directions[0].loss = 0;
    bearers_->link(0).change(bearers_->since_epoch(io::now()), change);
  });
  rest(100ms);
  const auto late = stream(from.get(), to.get(), 100);
  ASSERT_EQ(late.size(), 100U);
  EXPECT_GE(ms(late.front().delay), 100.0);
  EXPECT_LT(ms(late.front().delay), 120.0);

  do_there([&] { bearers_->link(0).outage(bearers_->since_epoch(io::now()), 2s); });
  rest(100ms);
  EXPECT_TRUE(stream(from.get(), to.get(), 100).empty());
  rest(2s);
  EXPECT_EQ(stream(from.get(), to.get(), 100).size(), 100U);
  const emu::DirectionStats seen = stats_->link(0).up.load();
  EXPECT_EQ(seen.packets_in, 400U);
  EXPECT_GE(seen.lost, 100U);
  EXPECT_EQ(seen.delivered, seen.packets_in - seen.lost);
}

TEST_F(NetemBackendTest, GoesOnWithoutANicThatIsGone) {
  up({"5g", "4g"});
  run();
  ASSERT_EQ(std::system("ip link del veth2"), 0);
  const io::FileDescriptor from = udp(true, 1);
  const io::FileDescriptor to = udp(false, 1);
  EXPECT_GE(stream(from.get(), to.get(), 100).size(), 95U);
  rest(200ms);
  stop();
  EXPECT_GT(backend_->effort().failed, 0U);
  EXPECT_GE(stats_->link(0).up.load().delivered, 95U);
}

}  // namespace
}  // namespace interneuron::netns::netem_backend_test
