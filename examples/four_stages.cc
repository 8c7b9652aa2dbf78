// Two pipelines at once over two roadside units. The camera's frames go to roadside A, which
// detects; its boxes go on to roadside B, which tracks, and B answers the vehicle. The lidar's
// sweeps go to A alone:
//
//   camera  vehicle ─1▶ A detects (2) ─3▶ B tracks (4) ─5▶ vehicle
//   lidar   vehicle ─1▶ A segments (2) ─3▶ vehicle
//
// The guard judges every stage at the node where it ends; offsets of all clocks cancel.
#include <chrono>

#include "loopback.h"
#include "voxels.h"

namespace in = interneuron;
using examples::to_bytes;
using std::chrono::milliseconds;

namespace {

constexpr const char* kHelp =
    "four_stages: camera and lidar of a vehicle, two roadside units, on the loopback card\n"
    "\n"
    "  four_stages     10 rounds of each\n"
    "\n"
    "Prints each round: its time, where it was answered, and who worked on it.\n";

constexpr int kRounds = 10;
constexpr in::PipelineId kCamera{1};
constexpr in::PipelineId kLidar{2};

// The result of a pipeline's computation at `name`, appended to what is there already.
in::Bytes worked_on(const in::Delivered& input, const char* name) {
  // What came from a sensor is large and no text.
  const std::string so_far = input.stage == 1 ? "" : examples::text_of(input.payload) + ", ";
  return to_bytes(so_far + name);
}

std::vector<in::PipelineConfig> pipelines() {
  using enum in::StageKind;
  return {{.id = kCamera,
           .stages = {kCommunication, kComputation, kCommunication, kComputation, kCommunication}},
          {.id = kLidar, .stages = in::offload_stages(), .policy = "best_link"}};
}

int serve_both(const std::vector<std::string>&) {
  // The tracker is roadside unit B, the detector roadside unit A.
  examples::Served tracker;
  examples::Served detector;
  examples::Served vehicle(pipelines());
  const in::PeerId detector_to_tracker = connect(detector.node, tracker);
  const in::PeerId vehicle_to_detector = connect(vehicle.node, detector);
  const in::PeerId tracker_to_vehicle = connect(tracker.node, vehicle);

  detector.node.on_delivered([&](const in::Delivered& input) {
    const bool camera = input.round.pipeline == kCamera;
    const in::PeerId next = camera ? detector_to_tracker : input.from;
    detector.node.submit(input.round, {worked_on(input, camera ? "detected" : "segmented")},
                         in::MessageClass::kResult, next);
  });
  tracker.node.on_delivered([&](const in::Delivered& input) {
    tracker.node.submit(input.round, {worked_on(input, "tracked")}, in::MessageClass::kResult,
                        tracker_to_vehicle);
  });

  const in::Bytes sweep = examples::to_message(examples::thinned(examples::made_up(), 0.4F));
  int begun = 0;
  int done = 0;
  std::function<void()> rounds = [&] {
    const in::RoundRef camera = vehicle.node.begin_round(kCamera);
    vehicle.node.submit(camera, {in::Bytes(512 * 1024), in::Bytes(128 * 1024)},
                        in::MessageClass::kData, vehicle_to_detector);
    const in::RoundRef lidar = vehicle.node.begin_round(kLidar);
    vehicle.node.submit(lidar, {sweep}, in::MessageClass::kData, vehicle_to_detector);
    if (++begun < kRounds) vehicle.node.after(milliseconds(100), rounds);
  };
  // Both must be there: one of them is heard of first.
  int ready = 0;
  vehicle.node.on_peer_ready([&](in::PeerReady) {
    if (++ready == 2) rounds();
  });
  vehicle.node.on_round_done([&](const in::RoundDone& answer) {
    examples::print(answer.round.pipeline == kCamera ? "camera" : "lidar ", answer);
    if (++done == 2 * kRounds) vehicle.node.stop();
  });
  vehicle.node.after(std::chrono::seconds(10), [] {
    throw std::runtime_error("a roadside does not answer; is the loopback card up?");
  });
  detector.start();
  tracker.start();
  vehicle.node.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return examples::run(argc, argv, kHelp, 0, serve_both); }
