#include "app/perception/accuracy.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "app/perception/openable.h"

namespace interneuron::perception {
namespace {

// COCO's evaluation parameters (pycocotools, Params.setDetParams).
// COCO averages over the IoU thresholds .50, .55 … .95.
constexpr int kIouThresholds = 10;
constexpr double kFirstIou = 0.5;
constexpr double kIouStep = 0.05;
// COCO interpolates precision at the recalls 0, .01 … 1.
constexpr int kRecallPoints = 101;
// Absorbs rounding, so that a box of exactly the threshold matches.
constexpr double kIouTolerance = 1e-9;

constexpr std::size_t kMotFields = 7;

// The first seven numbers of a line, or nothing.
std::optional<std::array<double, kMotFields>> read_fields(std::string_view line) {
  std::array<double, kMotFields> fields{};
  const char* at = line.data();
  const char* const end = at + line.size();
  for (std::size_t i = 0; i < kMotFields; ++i) {
    if (i > 0 && (at == end || *at++ != ',')) return {};
    const auto [after, error] = std::from_chars(at, end, fields[i]);
    if (error != std::errc{}) return {};
    at = after;
  }
  if (at != end && *at != ',') return {};
  return fields;
}

// One detection after matching at one threshold; those that match an ignore region are left out.
struct Verdict {
  float score;
  bool right;
  std::size_t times;
};

// A round prepared once for all thresholds: the boxes that count, and their overlap with the truth,
// persons before ignore regions.
struct Overlaps {
  std::size_t times = 1;
  std::vector<float> scores;
  // Element t: truth t is ignored.
  std::vector<bool> ignored;
  // Element [d][t]: the intersection over union of detection d and truth t.
  std::vector<std::vector<double>> iou;
};

Overlaps overlaps_of(const std::vector<TrueBox>& truth, const std::vector<Box>& shown) {
  std::vector<TrueBox> ordered = truth;
  std::stable_partition(ordered.begin(), ordered.end(), [](const TrueBox& t) { return !t.ignore; });
  std::vector<Box> boxes = shown;
  std::stable_sort(boxes.begin(), boxes.end(),
                   [](const Box& a, const Box& b) { return a.score > b.score; });
  if (boxes.size() > kMaxBoxes) boxes.resize(kMaxBoxes);

  Overlaps result;
  for (const TrueBox& t : ordered) result.ignored.push_back(t.ignore);
  for (const Box& box : boxes) {
    result.scores.push_back(box.score);
    std::vector<double>& row = result.iou.emplace_back();
    for (const TrueBox& t : ordered) row.push_back(iou(box, t.box));
  }
  return result;
}

// Greedy, best score first (pycocotools, evaluateImg): each detection takes the free person it
// overlaps most; only if there is none, an ignore region, which any number may share.
void match(const Overlaps& round, double threshold, std::vector<Verdict>& out) {
  const std::size_t truths = round.ignored.size();
  std::vector<bool> taken(truths, false);
  for (std::size_t d = 0; d < round.scores.size(); ++d) {
    double best = threshold - kIouTolerance;
    std::optional<std::size_t> match;
    for (std::size_t t = 0; t < truths; ++t) {
      if (taken[t] && !round.ignored[t]) continue;
      if (match && !round.ignored[*match] && round.ignored[t]) break;
      if (round.iou[d][t] < best) continue;
      best = round.iou[d][t];
      match = t;
    }
    if (match) taken[*match] = true;
    if (match && round.ignored[*match]) continue;
    out.push_back({round.scores[d], match.has_value(), round.times});
  }
}

struct Curve {
  // The mean over the recall points.
  double precision = 0;
  // At the last point, which is the highest.
  double recall = 0;
};

Curve summarise(std::vector<Verdict> verdicts, std::size_t truths) {
  std::stable_sort(verdicts.begin(), verdicts.end(),
                   [](const Verdict& a, const Verdict& b) { return a.score > b.score; });
  std::vector<double> precision;
  std::vector<double> recall;
  std::size_t right = 0;
  std::size_t all = 0;
  for (const Verdict& verdict : verdicts) {
    right += verdict.right ? verdict.times : 0;
    all += verdict.times;
    precision.push_back(static_cast<double>(right) / static_cast<double>(all));
    recall.push_back(static_cast<double>(right) / static_cast<double>(truths));
  }
  // At each recall, the best precision that this recall or a higher one has.
  for (std::size_t i = precision.size(); i-- > 1;) {
    precision[i - 1] = std::max(precision[i - 1], precision[i]);
  }
  Curve curve;
  for (int i = 0; i < kRecallPoints; ++i) {
    const double wanted = static_cast<double>(i) / (kRecallPoints - 1);
    const auto at = std::lower_bound(recall.begin(), recall.end(), wanted);
    if (at == recall.end()) break;
    curve.precision += precision[static_cast<std::size_t>(at - recall.begin())] / kRecallPoints;
  }
  if (!recall.empty()) curve.recall = recall.back();
  return curve;
}

struct Prepared {
  std::vector<Overlaps> rounds;
  // The persons to be found in all rounds.
  std::size_t truths = 0;
};

Prepared prepare(const GroundTruth& truth, std::span<const Shown> rounds) {
  static const std::vector<TrueBox> kNobody;
  Prepared prepared;
  for (const Shown& round : rounds) {
    const auto found = truth.find(round.frame);
    const std::vector<TrueBox>& boxes = found == truth.end() ? kNobody : found->second;
    prepared.rounds.push_back(overlaps_of(boxes, round.boxes));
    prepared.rounds.back().times = round.times;
    prepared.truths +=
        round.times * static_cast<std::size_t>(std::count_if(
                          boxes.begin(), boxes.end(), [](const TrueBox& t) { return !t.ignore; }));
  }
  return prepared;
}

}  // namespace

GroundTruth read_mot_truth(const std::filesystem::path& file) {
  std::ifstream in(file);
  const std::string name = "ground truth '" + file.string() + "': ";
  if (!in) check_openable("ground truth", file);
  if (!in) throw InputError(name + "cannot be read; run scripts/fetch_data.sh --ground-truth");
  GroundTruth truth;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    const auto fields = read_fields(line);
    // The upper bound keeps the conversion to int defined; it is far above any video's length.
    if (!fields || !((*fields)[0] >= 1 && (*fields)[0] <= 1e9)) {
      throw InputError(name + "line " + std::to_string(number) +
                       " is not 'frame,id,x,y,w,h,flag,…'; fetch the file again");
    }
    const auto& [frame, id, x, y, w, h, flag] = *fields;
    const Box box{.x = static_cast<float>(x - 1),
                  .y = static_cast<float>(y - 1),
                  .w = static_cast<float>(w),
                  .h = static_cast<float>(h)};
    truth[static_cast<int>(frame) - 1].push_back({box, flag < 0.5});
  }
  if (in.bad() || truth.empty()) {
    throw InputError(name + "holds no boxes; run scripts/fetch_data.sh --ground-truth");
  }
  return truth;
}

ShownShare share_shown(const GroundTruth& truth, std::span<const Shown> rounds, float min_score) {
  const Prepared prepared = prepare(truth, rounds);
  std::vector<Verdict> verdicts;
  for (const Overlaps& round : prepared.rounds) match(round, kFirstIou, verdicts);
  ShownShare result;
  std::size_t right = 0;
  for (const Verdict& verdict : verdicts) {
    if (!(verdict.score >= min_score)) continue;
    result.boxes += verdict.times;
    right += verdict.right ? verdict.times : 0;
  }
  const auto share = [right](std::size_t of) {
    return of == 0 ? 0 : static_cast<double>(right) / static_cast<double>(of);
  };
  result.precision = share(result.boxes);
  result.recall = share(prepared.truths);
  return result;
}

Accuracy evaluate(const GroundTruth& truth, std::span<const Shown> rounds) {
  Accuracy result;
  const Prepared prepared = prepare(truth, rounds);
  result.truths = prepared.truths;
  if (result.truths == 0) return result;
  for (int i = 0; i < kIouThresholds; ++i) {
    std::vector<Verdict> verdicts;
    for (const Overlaps& round : prepared.rounds) match(round, kFirstIou + i * kIouStep, verdicts);
    const Curve curve = summarise(std::move(verdicts), result.truths);
    if (i == 0) {
      result.ap50 = curve.precision;
      result.recall50 = curve.recall;
    }
    result.ap += curve.precision / kIouThresholds;
    result.ar += curve.recall / kIouThresholds;
  }
  return result;
}

}  // namespace interneuron::perception
