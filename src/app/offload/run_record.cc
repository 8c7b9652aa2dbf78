#include "app/offload/run_record.h"

#include <fmt/format.h>

#include <algorithm>

#include "app/offload/offload_request.h"
#include "interneuron/guard.h"
#include "perception/accuracy.h"
#include "perception/codec.h"
#include "perception/picture.h"

namespace interneuron::cli {

namespace perc = perception;

void RunRecord::begun(std::uint32_t round, const perc::Frame& frame) {
  ++counts_.begun;
  lab::RoundRow row;
  row.round = round;
  row.frame = frame.index;
  row.guard = guard_;
  rows_.push_back(row);
  shown_.emplace_back();
  if (!picture_round_ && (rounds_ == 0 || counts_.begun > rounds_ / 2)) picture_ = frame.bgr;
}

void RunRecord::planned(std::uint32_t round, const std::string& plan) {
  if (round >= rows_.size()) return;
  std::string& text = rows_[round].plan;
  if (!text.empty()) text += ' ';
  text += plan;
}

const lab::RoundRow& RunRecord::done(const RoundDone& event, Duration deadline) {
  lab::RoundRow& row = rows_[event.round.round.value];
  row.t0 = event.t0;
  row.answered = true;
  row.outcome = event.outcome;
  row.e2e = event.e2e;
  row.age_rounds = event.age_rounds;
  row.x_permille = event.x_permille;
  row.recovering = event.recovering;
  row.degraded_final = event.degraded_final;
  ++counts_.decided;
  const auto result = perc::decode_result(event.result);
  if (!result) return row;
  row.boxes = result->boxes.size();
  shown_[row.round] = {result->boxes, result->draw_score};
  if (event.outcome != Outcome::kRemote) return row;
  ++counts_.on_time;
  const auto full = std::chrono::duration_cast<std::chrono::microseconds>(kFullSeverity);
  row.road = lab::RoundRow::Road{
      static_cast<int>(result->variant),
      result->level,
      result->stage1_late,
      result->stage1_released,
      result->stage1_overrun == full ? deadline : Duration(result->stage1_overrun),
      Duration(result->compute_time)};
  const bool newest = row.round + 1 == counts_.begun;
  if (!picture_round_ && !picture_.empty() && newest) picture_round_ = row.round;
  return row;
}

void RunRecord::drop_undecided() {
  if (counts_.decided >= counts_.begun) return;
  rows_.resize(counts_.decided);
  shown_.resize(counts_.decided);
}

void RunRecord::compare(const std::filesystem::path& truth, lab::RunInfo& info) const {
  std::vector<perc::Shown> shown;
  std::vector<perc::Shown> drawn;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    shown.push_back({rows_[i].frame, shown_[i].boxes});
    drawn.push_back(shown.back());
    std::erase_if(drawn.back().boxes, [least = shown_[i].draw_score](const perc::Box& box) {
      return box.score < least;
    });
  }
  const perc::GroundTruth people = perc::read_mot_truth(truth);
  const perc::Accuracy a = perc::evaluate(people, shown);
  const perc::ShownShare share = perc::share_shown(people, drawn, 0);
  info.ap = a.ap;
  info.ap50 = a.ap50;
  info.ar = a.ar;
  info.drawn_precision = share.precision;
  info.drawn_recall = share.recall;
}

lab::Json RunRecord::write(const std::filesystem::path& folder, const lab::RunInfo& info) const {
  const lab::Json summary = lab::summarise(rows_, info);
  if (folder.empty()) return summary;
  lab::write_csv(folder / "rounds.csv", rows_);
  lab::write_json(folder / "summary.json", summary);
  if (picture_round_ && *picture_round_ < rows_.size()) {
    const lab::RoundRow& row = rows_[*picture_round_];
    const Shown& shown = shown_[row.round];
    const std::string caption = fmt::format(
        "round {}: answered by the roadside in {:.0f} ms, level {}, {} image", row.round,
        to_ms(row.e2e), row.road->level, row.road->variant == 0 ? "raw" : "sampled");
    perc::write_picture(folder / "frame.png", picture_, shown.boxes, caption, shown.draw_score);
  }
  lab::plot_latency(folder / "latency.png", rows_, summary);
  return summary;
}

}  // namespace interneuron::cli
