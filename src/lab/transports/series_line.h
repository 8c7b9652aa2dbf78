// What stderr tells of a series of runs, each of which takes a while.
#pragma once

#include <string>
#include <vector>

#include "app/process/status_line.h"
#include "interneuron/time.h"

namespace interneuron::transports {

// On a terminal a line that is written again and again and gone at the end, else a line for each
// run. For one thread; no errors.
class SeriesLine {
 public:
  // `times` are how long the runs take, about.
  SeriesLine(std::string series, std::vector<Duration> times);
  ~SeriesLine() { line_.clear(); }
  SeriesLine(const SeriesLine&) = delete;
  SeriesLine& operator=(const SeriesLine&) = delete;

  // The next run begins. It is called at most once for each of the times.
  void next(const std::string& run);
  // What makes the figures of this run doubtful; nothing is said where it is empty.
  void doubt(const std::string& reason);

 private:
  std::string series_;
  std::vector<Duration> times_;
  std::size_t begun_ = 0;
  std::string run_;
  process::StatusLine line_;
};

}  // namespace interneuron::transports
