// Pipelines and rounds: messages whose answer is wanted by a deadline, a layer beside the plain
// messages of send.h, which go one way. node.h is for an application with real sockets (or
// endpoint.h for the same without input and output), policy.h to write a policy of your own.
// examples/camera_offload.cc is a whole program.
//
// A vehicle needs a computation for each frame of its camera, and a roadside unit does it better
// than the vehicle itself, if its result is back in time. One frame is handled by one *round*. A
// round passes through *stages*, each of them a communication (a message travels to another host)
// or a computation. The usual pipeline has three:
//
//   vehicle    begin_round   submit(frame)                                 RoundDone
//              at t0             \                                          /
//                                 \ stage 1, uplink       stage 3, downlink/
//                                  v                                      /
//   roadside                   Delivered   begin_computation   submit(result)
//                                          stage 2, detection
//
// 1. begin_round() stamps t0. The round must be answered by t0 + PipelineConfig::deadline.
// 2. submit() hands over the message in one or more *variants*, from the best (raw) to the smallest
//    (down-sampled). The pipeline's *policy* decides which variants go over which links.
// 3. The roadside unit is told of the message by Delivered. begin_computation() lets the *guard*
//    choose a quality level that fits into the time that is left; submit() hands over the result.
// 4. Meanwhile the vehicle computes a cheap result of its own and hands it to local_result().
// 5. The vehicle gets exactly one RoundDone per round, at the latest at the deadline: with the
//    remote result if that is there in time, else with its own local one, else with the last one.
//
// Nothing blocks: what happens comes as events, rounds overlap, and a message that is too late is
// dropped. The *origin*, the endpoint that begins the rounds, alone configures the pipeline; the
// headers of its messages tell every other endpoint (docs/paper.md, "Rounds and stages").
#pragma once

#include <string>
#include <vector>

#include "interneuron/guard.h"
#include "interneuron/message.h"
#include "interneuron/round.h"
#include "interneuron/units.h"

namespace interneuron {

enum class StageKind : std::uint8_t { kCommunication, kComputation };

// The stages of an offloaded computation: its input goes to a peer, the peer computes, the result
// comes back.
inline std::vector<StageKind> offload_stages() {
  return {StageKind::kCommunication, StageKind::kComputation, StageKind::kCommunication};
}

// Stages of a pipeline; a message's header has one bit for each.
inline constexpr std::size_t kMaxStages = 16;

// How the rounds of one kind run. Only the endpoint where they begin has this.
struct PipelineConfig {
  // Unique within the endpoint.
  PipelineId id{};
  // 1 … kMaxStages stages. The last one must end at the origin, so a lone communication is refused.
  // Default: the usual three, uplink, detection, downlink.
  std::vector<StageKind> stages = offload_stages();
  // From t0 to the answer, > 0. Default: the paper's, 130 ms.
  Duration deadline = std::chrono::milliseconds(130);
  // Between two rounds, > 0. Default: 100 ms, a camera of 10 frames per second.
  Duration period = std::chrono::milliseconds(100);
  // The name of a registered policy.
  std::string policy = "down_sampling";
  // How much each property of a link matters to the messages: weights in [0, 1].
  Nature needs{.delay = 1.0};
  // Parameters of GuardKind::kPaper (docs/paper.md, "X and the timeout handler"); the other guard
  // ignores them. β is added to the tolerance X, in 1/1000.
  std::int16_t beta_permille = 0;
  GuardKind guard = GuardKind::kBudget;
  // Parameters of GuardKind::kBudget.
  BudgetOptions budget{};
  // What is known beforehand of the remote computation, from the lowest quality to the highest;
  // kBudget weighs with it what a transmission is worth. Default: learnt from the results.
  std::vector<LevelProfile> levels{};
  // What an answer without a remote result is worth. Default: not known.
  FallbackQuality fallback{};
};

}  // namespace interneuron
