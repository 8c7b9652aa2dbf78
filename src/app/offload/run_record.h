// The rounds of a vehicle's run as they happen, and what is left of them at the end: the files of
// src/lab/files/run_files.h, and one picture. Thread-compatible.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "interneuron/pipeline.h"
#include "lab/files/run_files.h"
#include "perception/detection.h"
#include "perception/frame_source.h"

namespace interneuron::cli {

class RunRecord {
 public:
  // `rounds`: how many there will be, 0 = nobody knows; the picture is of the middle.
  RunRecord(std::uint32_t rounds, std::string guard) : rounds_(rounds), guard_(std::move(guard)) {}

  // Rounds begin in the order of their numbers, from 0. The others need one that has begun.
  void begun(std::uint32_t round, const perception::Frame& frame);
  void planned(std::uint32_t round, const std::string& plan);
  const RoundRow& done(const RoundDone& event, Duration deadline);
  void drop_undecided();  // the rounds at the end that have no answer

  struct Counts {
    std::uint32_t begun = 0;
    std::uint32_t decided = 0;
    std::uint32_t on_time = 0;
  };
  Counts counts() const { return counts_; }
  std::uint32_t begun() const { return counts_.begun; }
  std::uint32_t decided() const { return counts_.decided; }
  double on_time_percent() const;

  // Accuracy against a ground truth (MOT15 gt.txt), into `info`.
  void compare(const std::filesystem::path& truth, RunInfo& info) const;
  // The summary; with a folder also its files.
  Json write(const std::filesystem::path& folder, const RunInfo& info) const;

 private:
  std::uint32_t rounds_;
  std::string guard_;
  Counts counts_;
  std::vector<RoundRow> rows_;
  // What the application was shown in each of rows_.
  struct Shown {
    std::vector<perception::Box> boxes;
    // Boxes scored below are not drawn.
    float draw_score = 0;
  };
  std::vector<Shown> shown_;
  cv::Mat picture_;  // the frame of the picture, and its round
  std::optional<std::uint32_t> picture_round_;
};

}  // namespace interneuron::cli
