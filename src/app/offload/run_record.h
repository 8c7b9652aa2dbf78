// Records the rounds of a vehicle's run as they happen and writes them at its end: rounds.csv,
// summary.json, a plot of the latencies and one picture with the boxes of its round.
//
// A vehicle may run for days, so memory does not grow with its rounds: all are tallied, rows go to
// the file as they are over, the plot shows the newest kMaxDrawn or more, and answers are kept for
// the accuracy of the first kMaxJudged rounds. The files appear together at the end or not at all;
// the plot, which needs another program, follows them. Fed by the vehicle's loop; boxes, levels and
// times in it are what the roadside unit says. Thread-compatible.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "app/perception/accuracy.h"
#include "app/perception/detection.h"
#include "app/perception/frame_source.h"
#include "app/records/run_files.h"
#include "app/records/staging.h"
#include "interneuron/pipeline.h"

namespace interneuron::offload {

class RunRecord {
 public:
  // Rounds that the plot shows at least when there are more: 33 minutes of ten a second, which is
  // 20 rounds per pixel. Up to twice as many are kept, 8 MB.
  static constexpr std::size_t kMaxDrawn = 20'000;
  // Rounds whose answers are kept to be compared with a ground truth: an hour of ten a second. With
  // 20 boxes each they take 15 MB.
  static constexpr std::size_t kMaxJudged = 36'000;

  struct Options {
    // How many rounds there will be; 0: nobody knows. The picture is of a round in the middle, or
    // of an early one.
    std::uint32_t rounds = 0;
    // "paper" or "budget".
    std::string guard{};
    // Folder of the files; empty: none are written, and no rows are kept.
    std::filesystem::path out{};
    // Whether compare() will be called.
    bool judged = false;
  };
  explicit RunRecord(Options options) : o_(std::move(options)) {}
  // Opens the files. Throws Failure (1) naming the folder or file.
  void open();

  // Rounds begin in the order of their numbers, from 0; planned() and done() are called for rounds
  // that have begun, done() once each.
  void begun(std::uint32_t round, const perception::Frame& frame);
  void planned(std::uint32_t round, const std::string& plan);
  records::RoundRow done(const RoundDone& event, Duration deadline);
  // Forgets the rounds that have no answer.
  void drop_undecided();

  struct Counts {
    std::uint32_t begun = 0;
    std::uint32_t decided = 0;
    std::uint32_t on_time = 0;
  };
  Counts counts() const { return counts_; }
  std::uint32_t begun() const { return counts_.begun; }
  std::uint32_t decided() const { return counts_.decided; }
  // Rows in memory, of whatever kind.
  std::size_t kept() const { return open_.size() + drawn_.size(); }

  // Ends the record: no round follows.
  void close();
  // Writes the accuracy against a ground truth (a gt.txt of MOT15) into `info`.
  void compare(const std::filesystem::path& truth, records::RunInfo& info) const;
  // Returns the summary, and writes the files if there is a folder. Throws Failure (1) naming the
  // file.
  records::Json write(const records::RunInfo& info);

 private:
  // What the application was shown.
  struct Shown {
    std::vector<perception::Box> boxes;
    // Boxes scored below are not drawn.
    float draw_score = 0;
  };
  struct Round {
    records::RoundRow row;
    Shown shown;
  };
  struct Files {
    explicit Files(const std::filesystem::path& folder)
        : staging(folder), csv(staging / "rounds.csv") {}
    records::Staging staging;
    records::CsvFile csv;
  };
  void take(Round& round);
  void keep_row(const records::RoundRow& row);
  std::string caption() const;

  Options o_;
  Counts counts_;
  records::RunTally tally_;
  // Rounds that are not over, or that wait for one before them: as many as overlap.
  std::map<std::uint32_t, Round> open_;
  std::vector<records::RoundRow> drawn_;
  // All boxes of a round, and those that are drawn.
  std::vector<perception::Shown> judged_;
  std::vector<perception::Shown> judged_drawn_;
  std::unique_ptr<Files> files_;
  // Why rows are not written any more, when their file is broken.
  std::string broken_;
  // The frame of the picture, and the round that it is of once that was answered.
  cv::Mat picture_;
  std::optional<Round> picture_round_;
};

}  // namespace interneuron::offload
