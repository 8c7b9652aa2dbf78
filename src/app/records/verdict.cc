#include "app/records/verdict.h"

#include <fmt/format.h>

#include "app/process/failure.h"

namespace interneuron::records {

std::string verdict(const Json& summary) {
  const auto count = [&summary](const char* key) { return summary[key].get<std::size_t>(); };
  const std::size_t rounds = count("rounds");
  if (rounds == 0) return "No round was begun.";
  const std::string in_time =
      fmt::format("by the roadside unit within {:g} ms", summary["deadline_ms"].get<double>());
  std::string text = fmt::format("{} of {} rounds answered {}", count("on_time"), rounds, in_time);
  if (count("local") > 0) {
    text += fmt::format("; {} answered by the vehicle itself", count("local"));
  }
  if (count("refused") > 0) {
    text += fmt::format(", {} because the policy sent nothing", count("refused"));
  }
  if (count("answers") < rounds) text += fmt::format("; {} unanswered", rounds - count("answers"));
  return text + ".";
}

int judge_objective(const Json& summary, double percent) {
  const auto rounds = summary["rounds"].get<double>();
  const double share = rounds > 0 ? 100 * summary["on_time"].get<double>() / rounds : 0;
  if (percent <= 0 || share >= percent) return process::kFine;
  fmt::print(
      stderr,
      "interneuron: objective missed: {:.1f} % of the rounds were on time, {:g} % were asked "
      "for; a longer --deadline-ms gives them more time\n",
      share, percent);
  return process::kObjectiveMissed;
}

}  // namespace interneuron::records
