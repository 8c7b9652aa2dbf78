// How good the boxes of a run are: COCO's average precision and recall against a MOT15 ground
// truth.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <span>
#include <vector>

#include "app/perception/detection.h"
#include "app/perception/input_error.h"

namespace interneuron::perception {

struct TrueBox {
  // Where the person is; its score is not used.
  Box box{};
  // Whether this is a region where a detection counts neither for nor against.
  bool ignore = false;
};

// By 0-based index of the frame in the video.
using GroundTruth = std::map<int, std::vector<TrueBox>>;

// Reads MOT15's gt.txt: lines "frame,id,x,y,w,h,flag,…", frame, x and y 1-based; flag 0 is an
// ignore region. Throws InputError when the file is missing or a line is not of this form.
GroundTruth read_mot_truth(const std::filesystem::path& file);

// What was on the screen for one frame. A round without a result has no boxes, and its persons are
// missed.
struct Shown {
  // 0-based; the same frame may come again when a video loops, and counts again.
  int frame = 0;
  std::vector<Box> boxes{};
  // In how many rounds just this was shown.
  std::size_t times = 1;
};

struct Accuracy {
  // The mean over IoU .50 … .95 of the precision at 101 recalls, and the same at IoU .50.
  double ap = 0;
  double ap50 = 0;
  // AR@100, the mean over IoU .50 … .95 of the recall reached, and the recall at IoU .50.
  double ar = 0;
  double recall50 = 0;
  // Persons to be found, over all rounds; all figures are 0 when there are none.
  std::size_t truths = 0;
};

// What a viewer gets who is shown the boxes of a score and above: at IoU .50, which share of these
// boxes shows a person, and which share of the persons has a box.
struct ShownShare {
  // 0 when no box is shown.
  double precision = 0;
  // 0 when there is nobody to be found.
  double recall = 0;
  // Boxes shown over all rounds, without those in ignore regions.
  std::size_t boxes = 0;
};

// Pure. Requires: as evaluate().
ShownShare share_shown(const GroundTruth& truth, std::span<const Shown> rounds, float min_score);

// The 100 best-scored boxes of each round count; area "all". Scores must be comparable across
// rounds: boxes of several levels mixed give what a viewer saw, which is what an effective accuracy
// is about. Pure.
Accuracy evaluate(const GroundTruth& truth, std::span<const Shown> rounds);

}  // namespace interneuron::perception
