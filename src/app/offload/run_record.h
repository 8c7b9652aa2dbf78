// Records the rounds of a vehicle's run as they happen and writes them at its end: rounds.csv,
// summary.json, a plot of the latencies and one picture with the boxes of its round. Memory grows
// with the rounds and their boxes. Thread-compatible.
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
  // `rounds` is how many there will be, 0 if nobody knows. The picture is of a round in the middle,
  // or of an early one.
  RunRecord(std::uint32_t rounds, std::string guard) : rounds_(rounds), guard_(std::move(guard)) {}

  // Rounds begin in the order of their numbers, from 0; planned() and done() are called for rounds
  // that have begun.
  void begun(std::uint32_t round, const perception::Frame& frame);
  void planned(std::uint32_t round, const std::string& plan);
  const lab::RoundRow& done(const RoundDone& event, Duration deadline);
  // Forgets the rounds at the end that have no answer.
  void drop_undecided();

  struct Counts {
    std::uint32_t begun = 0;
    std::uint32_t decided = 0;
    std::uint32_t on_time = 0;
  };
  Counts counts() const { return counts_; }
  std::uint32_t begun() const { return counts_.begun; }
  std::uint32_t decided() const { return counts_.decided; }

  // Writes the accuracy against a ground truth (a gt.txt of MOT15) into `info`.
  void compare(const std::filesystem::path& truth, lab::RunInfo& info) const;
  // Returns the summary, and writes the files if a folder is given. Throws Failure (1) naming the
  // file.
  lab::Json write(const std::filesystem::path& folder, const lab::RunInfo& info) const;

 private:
  std::uint32_t rounds_;
  std::string guard_;
  Counts counts_;
  std::vector<lab::RoundRow> rows_;
  // What the application was shown in each of rows_.
  struct Shown {
    std::vector<perception::Box> boxes;
    // Boxes scored below are not drawn.
    float draw_score = 0;
  };
  std::vector<Shown> shown_;
  // The frame of the picture, and the round that it is of once that was answered.
  cv::Mat picture_;
  std::optional<std::uint32_t> picture_round_;
};

}  // namespace interneuron::cli
