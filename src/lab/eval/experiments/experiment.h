// What an experiment of `interneuron eval` is, and those that run in virtual time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "host/process/progress.h"
#include "lab/eval/experiments/scorer.h"
#include "lab/files/run_files.h"

namespace interneuron::cli::eval {

struct Request {
  std::uint32_t rounds = 300;  // per seed, >= 1
  std::uint64_t first_seed = 1;
  std::uint64_t last_seed = 30;  // >= first_seed
  const Scorer& scorer;
  Progress& progress;
  std::optional<std::filesystem::path> data{};
  // Of the testbed: a folder that may be made, and what detects.
  std::filesystem::path scratch{};
  std::string ladder = "auto";

  std::size_t seeds() const { return static_cast<std::size_t>(last_seed - first_seed) + 1; }
};

struct Experiment {
  const char* name;
  const char* title;
  std::uint32_t rounds;  // by default
  std::uint64_t seeds;   // by default 1 … seeds
  bool scored;           // tells AP and AR
  // Fills in tables, series and notes. Throws Failure.
  void (*run)(const Request& request, Json& document);
  // The same on real sockets; nullptr: makes no sense there.
  void (*run_on_testbed)(const Request& request, Json& document) = nullptr;
};

// One file of an experiment group each.
void run_table_network(const Request& request, Json& document);
void run_fig_adjust(const Request& request, Json& document);
void run_fig_rt(const Request& request, Json& document);
void run_table_erdos(const Request& request, Json& document);
void run_timeout_handler(const Request& request, Json& document);
void run_ladder(const Request& request, Json& document);
void run_clock(const Request& request, Json& document);
void run_sweep(const Request& request, Json& document);

}  // namespace interneuron::cli::eval
