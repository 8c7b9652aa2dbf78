// The paper's pipeline: a vehicle sends each frame to a roadside unit, which detects and answers; a
// local backup runs beside it. Frames and detection are stand-ins; the messages have the paper's
// sizes, and the levels its ladder's times.
#include <chrono>

#include "loopback.h"

namespace in = interneuron;
using examples::to_bytes;
using std::chrono::milliseconds;

namespace {

constexpr const char* kHelp =
    "camera_offload: frames go to a roadside unit over two links, on this machine's loopback card\n"
    "\n"
    "  camera_offload [ROUNDS]     10 rounds at 10 Hz unless ROUNDS says otherwise\n"
    "\n"
    "Prints each round's answer: its time, where it was computed, at which level.\n";

constexpr std::size_t kRawBytes = 512 * 1024;
constexpr std::size_t kSampledBytes = 128 * 1024;

// What the roadside knows of its detectors, from the lightest to the best.
std::vector<in::LevelProfile> ladder() {
  return {{milliseconds(8), milliseconds(10), {0.136, 0.128}},
          {milliseconds(19), milliseconds(24), {0.348, 0.327}},
          {milliseconds(44), milliseconds(48), {0.396, 0.383}}};
}

// The roadside: chooses the level when a frame is handed over, computes on a worker, answers.
void serve(examples::Served& road) {
  road.node.on_delivered([&road](const in::Delivered& frame) {
    const auto levels = ladder();
    const std::size_t level = road.node.begin_computation(frame.round, levels, levels.size() - 1);
    const std::string what = frame.variant == 0 ? "raw" : "sampled";
    road.node.compute(in::Queue::kComputation, [&road, levels, level, what, ref = frame.round] {
      std::this_thread::sleep_for(levels[level].median);  // the detection
      return [&road, level, what, ref] {
        const std::string result = "level " + std::to_string(level) + " on " + what;
        road.node.submit(ref, {to_bytes(result)}, in::MessageClass::kResult);
      };
    });
  });
  road.start();
}

int offload(const std::vector<std::string>& arguments) {
  const int rounds = arguments.empty() ? 10 : std::atoi(arguments[0].c_str());
  if (rounds < 1) throw std::runtime_error("ROUNDS must be a number from 1 on");
  examples::Served road;
  serve(road);

  in::NodeOptions options;
  options.insecure = true;  // on the loopback card; hello.cc has keys
  options.links = examples::two_links();
  for (in::NodeLink& link : options.links) {
    link.peer = to_string(road.reached_over(link.id).second);
  }
  options.pipelines = {
      {.stages = in::offload_stages(), .policy = "down_sampling", .levels = ladder()}};
  in::Node vehicle(options);
  int done = 0;
  std::function<void()> round = [&] {
    const in::RoundRef ref = vehicle.begin_round({});
    const in::SubmitStatus status = vehicle.submit(
        ref, {in::Bytes(kRawBytes), in::Bytes(kSampledBytes)}, in::MessageClass::kData);
    if (status != in::SubmitStatus::kAccepted) {  // the local backup will answer the round
      std::fprintf(stderr, "frame %u not sent: %s\n", ref.round.value, to_string(status).data());
    }
    vehicle.compute(in::Queue::kLocalBackup, [&vehicle, ref]() -> in::Node::Task {
      std::this_thread::sleep_for(milliseconds(20));  // the lightest level, on a small computer
      return [&vehicle, ref] { vehicle.local_result(ref, to_bytes("level 0, backup")); };
    });
    if (static_cast<int>(ref.round.value) + 1 < rounds) vehicle.after(milliseconds(100), round);
  };
  vehicle.on_peer_ready([&](in::PeerReady) { round(); });
  vehicle.on_round_done([&](const in::RoundDone& answer) {
    examples::print("camera", answer);
    if (++done == rounds) vehicle.stop();
  });
  vehicle.after(std::chrono::seconds(10) + rounds * milliseconds(200), [] {
    throw std::runtime_error("the roadside does not answer; is the loopback card up?");
  });
  vehicle.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return examples::run(argc, argv, kHelp, 1, offload); }
