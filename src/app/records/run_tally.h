// Counts the rounds of a run as they are over, in memory that does not grow with them: what
// summary.json says of a run of any length.
//
// The vehicle feeds it one row per round. The links and levels that rows name come from this host
// and from the roadside unit; of plans and levels kMaxKinds different ones each are told apart, and
// the rest are counted as "others" (level -1). Pure; thread-compatible; never throws.
#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "app/records/run_files.h"

namespace interneuron::records {

// The mean of any number of values, and quantiles of them: exact up to kMaxValues, which are 2.8 h
// of ten rounds a second; beyond, of a random sample of so many (the first of a fixed seed), whose
// rank is off by less than 0.2 % in 95 of 100 cases.
class Sample {
 public:
  static constexpr std::size_t kMaxValues = 100'000;

  void add(double value);
  // p50, p95, p99 and mean.
  Json json() const;
  std::size_t kept() const { return values_.size(); }

 private:
  std::vector<double> values_;
  double sum_ = 0;
  std::uint64_t count_ = 0;
  std::mt19937_64 random_{1};
};

class RunTally {
 public:
  // No measurement behind this value: a run has a handful of links and levels.
  static constexpr std::size_t kMaxKinds = 256;

  void add(const RoundRow& row);
  // What summarise() gives for all rows that were added.
  Json summary(const RunInfo& info) const;

 private:
  Sample on_time_ms_;
  Sample all_ms_;
  std::uint64_t rounds_ = 0;
  std::uint64_t answers_ = 0;
  std::uint64_t on_time_ = 0;
  std::uint64_t not_fresh_ = 0;
  std::uint64_t refused_ = 0;
  std::uint64_t possible_ = 0;
  // Whether every answered round was compared with a clairvoyant.
  bool judged_ = true;
  std::map<int, std::uint64_t> levels_;
  std::map<std::string, std::uint64_t> used_;
  std::map<std::string, std::uint64_t> plans_;
};

}  // namespace interneuron::records
