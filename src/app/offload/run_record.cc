#include "app/offload/run_record.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "app/perception/codec.h"
#include "app/perception/picture.h"
#include "app/process/failure.h"
#include "app/process/whole_file.h"
#include "interneuron/guard.h"

namespace interneuron::offload {

namespace perc = perception;

void RunRecord::open() {
  if (!o_.out.empty()) files_ = std::make_unique<Files>(o_.out);
}

void RunRecord::begun(std::uint32_t round, const perc::Frame& frame) {
  ++counts_.begun;
  records::RoundRow& row = open_[round].row;
  row.round = round;
  row.frame = frame.index;
  row.guard = o_.guard;
  const bool wanted = o_.rounds == 0 || counts_.begun > o_.rounds / 2;
  if (files_ && !picture_round_ && wanted) picture_ = frame.bgr;
}

void RunRecord::planned(std::uint32_t round, const std::string& plan) {
  const auto known = open_.find(round);
  if (known == open_.end()) return;
  std::string& text = known->second.row.plan;
  if (!text.empty()) text += ' ';
  text += plan;
}

records::RoundRow RunRecord::done(const RoundDone& event, Duration deadline) {
  Round& round = open_[event.round.round.value];
  records::RoundRow& row = round.row;
  row.round = event.round.round.value;
  row.t0 = event.t0;
  row.answered = true;
  row.outcome = event.outcome;
  row.e2e = event.e2e;
  row.age_rounds = event.age_rounds;
  row.x_permille = event.x_permille;
  row.recovering = event.recovering;
  row.degraded_final = event.degraded_final;
  ++counts_.decided;
  if (const auto result = perc::decode_result(event.result)) {
    row.boxes = result->boxes.size();
    round.shown = {result->boxes, result->draw_score};
    if (event.outcome == Outcome::kRemote) {
      ++counts_.on_time;
      const auto full = std::chrono::duration_cast<std::chrono::microseconds>(kFullSeverity);
      row.road = records::RoundRow::Road{
          std::string(perc::to_string(result->variant)),
          result->level,
          result->stage1_late,
          result->stage1_released,
          result->stage1_overrun == full ? deadline : Duration(result->stage1_overrun),
          Duration(result->compute_time)};
      const bool newest = row.round + 1 == counts_.begun;
      if (!picture_round_ && !picture_.empty() && newest) picture_round_ = round;
    }
  }
  const records::RoundRow decided = row;
  while (!open_.empty() && open_.begin()->second.row.answered) {
    take(open_.begin()->second);
    open_.erase(open_.begin());
  }
  return decided;
}

// A round that is over, in the order of their numbers.
void RunRecord::take(Round& round) {
  tally_.add(round.row);
  keep_row(round.row);
  if (!o_.judged || judged_.size() >= kMaxJudged) return;
  judged_.push_back({round.row.frame, std::move(round.shown.boxes)});
  judged_drawn_.push_back(judged_.back());
  std::erase_if(judged_drawn_.back().boxes, [least = round.shown.draw_score](const perc::Box& box) {
    return box.score < least;
  });
}

// The run goes on when its file breaks, as the application's answers matter more; its end tells.
void RunRecord::keep_row(const records::RoundRow& row) {
  if (!files_ || !broken_.empty()) return;
  drawn_.push_back(row);
  if (drawn_.size() >= 2 * kMaxDrawn) {
    drawn_.erase(drawn_.begin(), drawn_.begin() + std::ptrdiff_t{kMaxDrawn});
  }
  try {
    files_->csv.add(row);
  } catch (const process::Failure& failure) {
    broken_ = failure.what();
    spdlog::error("{}", broken_);
  }
}

void RunRecord::drop_undecided() {
  std::erase_if(open_, [](const auto& entry) { return !entry.second.row.answered; });
}

void RunRecord::close() {
  for (auto& [number, round] : open_) take(round);
  open_.clear();
}

void RunRecord::compare(const std::filesystem::path& truth, records::RunInfo& info) const {
  if (judged_.size() >= kMaxJudged) {
    spdlog::warn("AP and AR are those of the first {} rounds", kMaxJudged);
  }
  const perc::GroundTruth people = perc::read_mot_truth(truth);
  const perc::Accuracy a = perc::evaluate(people, judged_);
  const perc::ShownShare share = perc::share_shown(people, judged_drawn_, 0);
  info.ap = a.ap;
  info.ap50 = a.ap50;
  info.ar = a.ar;
  info.drawn_precision = share.precision;
  info.drawn_recall = share.recall;
}

std::string RunRecord::caption() const {
  const records::RoundRow& row = picture_round_->row;
  return fmt::format("round {}: answered by the roadside in {:.0f} ms, level {}, {} image",
                     row.round, to_ms(row.e2e), row.road->level, row.road->variant);
}

records::Json RunRecord::write(const records::RunInfo& info) {
  close();
  records::Json summary = tally_.summary(info);
  if (!files_) return summary;
  if (!broken_.empty()) throw process::Failure(process::kFailed, broken_);
  files_->csv.commit();
  records::write_json(files_->staging / "summary.json", summary);
  if (picture_round_) {
    const Shown& shown = picture_round_->shown;
    process::write_whole(files_->staging / "frame.png",
                         perc::png_picture(picture_, shown.boxes, caption(), shown.draw_score));
  }
  files_->staging.publish();
  files_.reset();
  records::plot_latency(o_.out / "latency.png", drawn_, summary);
  return summary;
}

}  // namespace interneuron::offload
