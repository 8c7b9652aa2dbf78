// One run of one system on the testbed. `eval --testbed` writes it to a file and passes that to the
// programs `vehicle` and `road` with --testbed-run FILE, which no help shows. Each program acts by
// it through its hooks and leaves its record beside that file: vehicle.json and road.json.
#pragma once

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "app/offload/hooks.h"
#include "app/records/run_files.h"
#include "interneuron/node.h"
#include "interneuron/transport.h"
#include "lab/eval/erdos.h"
#include "lab/eval/run.h"
#include "lab/eval/system.h"
#include "lab/eval/trace.h"

namespace interneuron::eval_testbed {

struct TestbedRun {
  eval::System system;
  // By round; further rounds have none.
  std::vector<eval::Injected> injected;
  // For LevelRule::kErdos; the vehicle has it as its own option too.
  Duration deadline = eval::Scenario{}.deadline;
  eval::ErdosTimes erdos;
  // The roadside's ladder. If empty, the roadside calibrates it.
  std::vector<LevelProfile> levels;
  FallbackQuality fallback;
  // Where it was read from.
  std::filesystem::path file;

  // The delay that is injected into this module of the round; zero if none is.
  Duration in(eval::Module module, RoundId round) const;
};

// They throw Failure naming the file: 1 when it cannot be written or read, 3 when it is no such
// run.
void write_testbed_run(const std::filesystem::path& file, const TestbedRun& run);
TestbedRun read_testbed_run(const std::filesystem::path& file);

// The levels as the roadside's record has them. A level of unknown quality gets one by its rank.
std::vector<LevelProfile> levels_of(const records::Json& levels);

// Makes the vehicle run the system of a TestbedRun, injects into its uplink and records its rounds.
// Thread-compatible.
class TestbedVehicle : public offload::VehicleHooks {
 public:
  explicit TestbedVehicle(TestbedRun run) : run_(std::move(run)) {}

  void configure(PipelineConfig& pipeline) const override;
  void configure(NodeOptions& node) const override;
  // The variants that the system submits.
  Variants submitted(const RoundRef& ref, Variants variants) override;
  bool local_backup() const override { return run_.system.local_backup; }
  void done(const RoundDone& event, const records::RoundRow& row) override;
  // Writes vehicle.json.
  void finished(const std::vector<Statistics::Link>& links) override;

 private:
  TestbedRun run_;
  // By round.
  std::vector<TimePoint> submitted_;
  records::Json rounds_ = records::Json::array();
};

// Makes the roadside unit run the system of a TestbedRun, injects into its computation and its
// downlink and records its computations. Thread-compatible, but inside_compute() may be called by
// any thread.
class TestbedRoad : public offload::RoadHooks {
 public:
  explicit TestbedRoad(TestbedRun run) : run_(std::move(run)) {}

  void configure(NodeOptions& node) const override;
  std::span<const LevelProfile> levels() const override { return run_.levels; }
  Duration before_compute(RoundId round) const override;
  Duration inside_compute(RoundId round) const override;
  // The level of systems that do not ask the guard; nothing for the others.
  std::optional<std::size_t> level(std::span<const LevelProfile> levels, TimePoint delivered,
                                   TimePoint now) const override;
  void computed(const computing::Computed& computed) override;
  // Writes road.json.
  void finished(const std::string& ladder, const std::vector<std::string>& names,
                std::span<const LevelProfile> levels) override;

 private:
  TestbedRun run_;
  records::Json rounds_ = records::Json::array();
};

// A transport that sends some datagrams later: how experiments on the testbed inject delays into
// the real programs. Links stay in order, as in sim::World::delay_with(): later datagrams on the
// same link wait for a delayed one.
//
// Wraps the transport of one link, which it owns. While nothing is delayed it passes everything on
// at once; delayed datagrams are copied and sent by a thread of its own. Their number has no bound
// here: the sender's pacing and the deadline of rounds bound what it hands over. Errors of the
// inner transport end the link as they would without this class. The calls are thread-compatible.
class DelayedTransport final : public Transport {
 public:
  // `delay_of` tells how much later a datagram is sent. It is asked by send(), on its caller's
  // thread, and asked again for datagrams that send() did not take.
  DelayedTransport(std::unique_ptr<Transport> inner,
                   std::function<Duration(const Outgoing&)> delay_of);

  BatchResult send(std::span<const Outgoing> batch) override;
  std::span<const Incoming> receive() override;
  bool drained() const override;
  TransportCaps capabilities() const override;
  TransportCounters counters() const override;
  Address local_address() const override;
  int native_handle() const override;

 private:
  struct Waiting {
    TimePoint due{};
    Address to{};
    Bytes bytes;
    std::uint8_t ecn = 0;
  };
  void send_waiting(const std::stop_token& stop);
  void send_due(TimePoint now);

  mutable std::mutex mutex_;
  std::condition_variable_any wake_;
  // Guarded by mutex_, as are waiting_, blocked_ and gone_.
  std::unique_ptr<Transport> inner_;
  std::function<Duration(const Outgoing&)> delay_of_;
  // In the order of `due`.
  std::deque<Waiting> waiting_;
  bool blocked_ = false;
  int gone_ = 0;
  // Declared last, so that it has ended before the others are destroyed.
  std::jthread thread_;
};

}  // namespace interneuron::eval_testbed
