// `interneuron eval --testbed`: the delays that it injects, what it tells its programs, and a short
// run of it.
#include <condition_variable>
#include <fstream>
#include <iterator>
#include <mutex>

#include "lab/eval_testbed/testbed_run.h"
#include "node/io/steady_clock.h"
#include "tests/app/cli/support.h"
#include "tests/app/watch/json_schema.h"
#include "tests/run_queue.h"

namespace interneuron::eval_testbed::eval_testbed_test {
namespace {

using cli::no_testbed;
using cli::Ran;
using cli::run;
using cli::TempFolder;

using namespace std::chrono_literals;
namespace core = interneuron::eval;
namespace fs = std::filesystem;

// What left, and when.
struct Wire {
  struct Packet {
    char first = 0;
    TimePoint at{};
  };
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<Packet> packets;

  std::vector<Packet> await(std::size_t count) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, 10s, [&] { return packets.size() >= count; });
    return packets;
  }
};

class FakeTransport final : public Transport {
 public:
  explicit FakeTransport(Wire& wire) : wire_(wire) {}
  BatchResult send(std::span<const Outgoing> batch) override {
    const std::scoped_lock lock(wire_.mutex);
    for (const Outgoing& o : batch) {
      wire_.packets.push_back({static_cast<char>(o.head[0]), io::now()});
    }
    wire_.changed.notify_all();
    return {batch.size(), false, 0};
  }
  std::span<const Incoming> receive() override { return {}; }
  TransportCaps capabilities() const override { return {}; }
  TransportCounters counters() const override { return {}; }
  Address local_address() const override { return {}; }
  int native_handle() const override { return -1; }

 private:
  Wire& wire_;
};

TEST(EvalTestbed, DelaysWhatItIsToldAndKeepsTheOrder) {
  Wire wire;
  DelayedTransport transport(std::make_unique<FakeTransport>(wire), [](const Outgoing& datagram) {
    return static_cast<char>(datagram.head[0]) == 'd' ? Duration(30ms) : Duration{};
  });
  const TimePoint sent = io::now();
  for (const char text : {'a', 'd', 'b'}) {
    const Bytes bytes{static_cast<std::byte>(text)};
    const Outgoing one{{}, bytes};
    EXPECT_EQ(transport.send({&one, 1}).taken, 1U);
  }
  const auto packets = wire.await(3);
  ASSERT_EQ(packets.size(), 3U);
  EXPECT_EQ(packets[0].first, 'a');
  EXPECT_EQ(packets[1].first, 'd');
  EXPECT_EQ(packets[2].first, 'b');
  EXPECT_LT(packets[0].at, sent + 30ms);
  EXPECT_GE(packets[1].at, sent + 30ms);
}

TEST(EvalTestbed, ItsOrdersAreReadAsTheyWereWritten) {
  const TempFolder folder;
  TestbedRun run;
  run.system = *core::find_system("erdos_like");
  run.injected = core::make_trace({}, 7, 40).rounds;
  run.deadline = 141ms;
  run.erdos = {20ms, 10ms, {8ms, 45ms}};
  run.levels = {{7ms, 9ms, {0.1, 0.09}}, {40ms, 44ms, {0.4, 0.38}}};
  run.fallback = {0.1, {0.6, 0.3}};
  write_testbed_run(folder / "run.json", run);
  const TestbedRun back = read_testbed_run(folder / "run.json");
  EXPECT_EQ(back.system.name, "erdos_like");
  EXPECT_EQ(back.injected, run.injected);
  EXPECT_EQ(back.deadline, 141ms);
  EXPECT_EQ(back.erdos.runtime, run.erdos.runtime);
  EXPECT_EQ(back.levels.at(1).quality, run.levels[1].quality);
  EXPECT_EQ(back.fallback.stale_share, run.fallback.stale_share);
  // Each delay is in one module alone.
  for (std::uint32_t i = 0; i < run.injected.size(); ++i) {
    Duration sum{};
    for (std::size_t m = 0; m < core::kModules; ++m) {
      sum += back.in(static_cast<core::Module>(m), RoundId{i});
    }
    EXPECT_EQ(sum, run.injected[i].delay);
  }
  EXPECT_EQ(back.in(core::Module::kUplink, RoundId{40}), Duration{});
}

TEST(EvalTestbed, ItsRoadsideDecidesByTheDeadlineOfTheRun) {
  TestbedRun run;
  run.system = *core::find_system("erdos_like");
  run.erdos = {60ms, 10ms, {8ms, 45ms}};
  const std::vector<LevelProfile> levels(2);
  const auto level_with = [&](Duration deadline) {
    run.deadline = deadline;
    return TestbedRoad(run).level(levels, TimePoint{}, TimePoint{});
  };
  EXPECT_EQ(level_with(115ms), 1U);
  EXPECT_EQ(level_with(114ms), 0U);
}

// An undisturbed round of erdos_like in virtual time, on hosts that take so long.
core::Round round_on(const sim::HostTimes& hosts) {
  core::Scenario scenario = core::table_erdos_scenario();
  scenario.hosts = hosts;
  core::Trace quiet;
  quiet.rounds.resize(10);
  return core::run(*core::find_system("erdos_like"), scenario, quiet, 1).rounds.back();
}

TEST(EvalTestbed, ItsSimulationTakesTheTimesOfTheHosts) {
  const core::Round without = round_on({});
  ASSERT_TRUE(without.on_time);
  const core::Round with =
      round_on({.encode = sim::kEncode + 1ms, .image_packets = 2ms, .result_packets = 4ms});
  ASSERT_TRUE(with.on_time);
  // Links serve packets to the microsecond.
  EXPECT_NEAR(to_ms(*with.delivered - *without.delivered), 3, 0.01);
  EXPECT_NEAR(to_ms(with.e2e - *with.compute_ended) - to_ms(without.e2e - *without.compute_ended),
              4, 0.01);
}

TEST(EvalTestbed, RunsTheSystemsForReal) {
  const fs::path data = places::source() + "/../shared/data";
  if (!fs::is_regular_file(data / "pets/vtest.avi")) GTEST_SKIP() << "no video";
  const std::string why = no_testbed();
  if (!why.empty()) GTEST_SKIP() << why;
  const TempFolder folder;
  const std::string log = (folder / "log").string();
  Ran ran;
  std::string complaint;
  // It measures first how long undisturbed rounds take, and gives up where none is on time.
  for (int attempt = 0; attempt < 3; ++attempt) {
    const RunQueue queue;
    fs::remove_all(folder / "out");
    ran = run("eval table-erdos --testbed --rounds 10 --seeds 2..2 --json --data '" +
                  data.string() + "' --out '" + (folder / "out").string() + "' 2>'" + log + "'",
              false);
    std::ifstream in(log);
    complaint.assign(std::istreambuf_iterator<char>(in), {});
    if (complaint.find("no undisturbed round was on time") == std::string::npos) break;
    if (!queue.busy()) break;
    if (attempt == 2) GTEST_SKIP() << "the machine is too busy: " << complaint;
  }
  ASSERT_EQ(ran.code, 0) << complaint;
  const auto document = nlohmann::json::parse(ran.output, nullptr, false);
  ASSERT_FALSE(document.is_discarded()) << ran.output;
  for (const std::string& violation : watch::violations(watch::schema_of("eval.json"), document)) {
    ADD_FAILURE() << violation;
  }
  EXPECT_EQ(document["mode"], "testbed");
  const auto& rows = document["tables"][0]["rows"];
  for (const char* name : {"ours", "paper", "erdos_like"}) {
    const auto row =
        std::ranges::find_if(rows, [name](const auto& r) { return r["name"] == name; });
    ASSERT_NE(row, rows.end()) << name;
    EXPECT_EQ((*row)["rounds"], 10) << name;
    EXPECT_GT((*row)["bytes"]["per_round"], 1000) << name;
  }
  EXPECT_EQ(document["tables"][2]["name"], "agreement");
  for (const auto& row : document["tables"][2]["rows"]) {
    EXPECT_EQ(row["points_aim"], row["name"] == "erdos_like" ? 0.03 : 0.02);
  }
  // Nothing but the document stays.
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "out"), fs::directory_iterator()), 1);
}

}  // namespace
}  // namespace interneuron::eval_testbed::eval_testbed_test
