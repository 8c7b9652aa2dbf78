// What an experiment of `interneuron eval` is, and those that run in virtual time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "app/process/progress.h"
#include "lab/eval/experiments/document.h"
#include "lab/eval/experiments/scorer.h"

namespace interneuron::experiments {

struct Request {
  // The rounds of each seed, at least 1.
  std::uint32_t rounds = 300;
  // Every seed from the first to the last, both included, is run.
  std::uint64_t first_seed = 1;
  std::uint64_t last_seed = 30;
  const Scorer& scorer;
  process::Progress& progress;
  std::optional<std::filesystem::path> data{};
  // What the testbed needs: a folder that may be made, and what detects.
  std::filesystem::path scratch{};
  std::string ladder = "auto";
  // Empty: the testbed measures one, see lab/eval_testbed/testbed.h.
  std::optional<Duration> deadline{};
  // In virtual time: the endpoints have keys.
  bool is_encrypted = false;

  std::size_t seeds() const { return static_cast<std::size_t>(last_seed - first_seed) + 1; }
};

struct Experiment {
  const char* name;
  const char* title;
  // By default: so many rounds on each of the seeds 1 to `seeds`.
  std::uint32_t rounds;
  std::uint64_t seeds;
  // Whether it tells AP and AR.
  bool scored;
  // Whether Request::is_encrypted may be asked for.
  bool encryptable;
  // Fills in tables, series and notes. Throws process::Failure.
  void (*run)(const Request& request, Document& document);
  // The same on real sockets; nullptr where that makes no sense.
  void (*run_on_testbed)(const Request& request, Document& document) = nullptr;
};

// One file of an experiment group each.
void run_table_network(const Request& request, Document& document);
void run_fig_adjust(const Request& request, Document& document);
void run_fig_rt(const Request& request, Document& document);
void run_table_erdos(const Request& request, Document& document);
void run_timeout_handler(const Request& request, Document& document);
void run_ladder(const Request& request, Document& document);
void run_clock(const Request& request, Document& document);
void run_sweep(const Request& request, Document& document);
void run_table_lidar(const Request& request, Document& document);

}  // namespace interneuron::experiments
