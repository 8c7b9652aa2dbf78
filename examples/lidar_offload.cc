// Lidar sweeps go to a roadside unit: whole over one link, thinned by a grid of voxels over the
// other. The policy `joint` chooses by what each is worth and how long it takes.
#include <chrono>

#include "loopback.h"
#include "voxels.h"

namespace in = interneuron;
using std::chrono::milliseconds;

namespace {

constexpr const char* kHelp =
    "lidar_offload: lidar sweeps go to a roadside unit over two links, on the loopback card\n"
    "\n"
    "  lidar_offload [SWEEP.bin]     a KITTI sweep; without one, a made-up sweep of 32,000 points\n"
    "\n"
    "Prints each of 10 rounds: its time, where it was answered, and how many points arrived.\n";

constexpr int kRounds = 10;
// The edge of a voxel, metres.
constexpr float kVoxel = 0.4F;

int offload(const std::vector<std::string>& arguments) {
  const examples::Sweep sweep =
      arguments.empty() ? examples::made_up() : examples::read_kitti(arguments[0]);
  const examples::Sweep few = examples::thinned(sweep, kVoxel);
  std::printf("sweep of %zu points, %zu in voxels of %.1f m\n", sweep.size(), few.size(),
              static_cast<double>(kVoxel));

  examples::Served road;
  road.node.on_delivered([&road](const in::Delivered& cloud) {
    const std::size_t points = cloud.payload.size() / sizeof(examples::Point);
    road.node.submit(cloud.round, {examples::to_bytes(std::to_string(points) + " points")},
                     in::MessageClass::kResult);
  });
  road.start();

  in::NodeOptions options;
  options.insecure = true;  // on the loopback card; hello.cc has keys
  options.links = examples::two_links();
  for (in::NodeLink& link : options.links) {
    link.peer = to_string(road.reached_over(link.id).second);
  }
  options.pipelines = {{.stages = in::offload_stages(), .policy = "joint"}};
  in::Node vehicle(options);
  int done = 0;
  std::function<void()> round = [&] {
    const in::RoundRef ref = vehicle.begin_round({});
    vehicle.submit(ref, {examples::to_message(sweep), examples::to_message(few)},
                   in::MessageClass::kData);
    if (ref.round.value + 1 < kRounds) vehicle.after(milliseconds(100), round);
  };
  vehicle.on_peer_ready([&](in::PeerReady) { round(); });
  vehicle.on_round_done([&](const in::RoundDone& answer) {
    examples::print("lidar", answer);
    if (++done == kRounds) vehicle.stop();
  });
  vehicle.after(std::chrono::seconds(10), [] {
    throw std::runtime_error("the roadside does not answer; is the loopback card up?");
  });
  vehicle.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return examples::run(argc, argv, kHelp, 1, offload); }
